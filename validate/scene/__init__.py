"""What is simulated, declared: mesh, materials, supports, drives, cavities. No matrices."""

from validate.exports import lazily, names

_HOMES = {
    "mesh": ("Mesh", "quadratic"),
    "filled": ("filled",),
    "foreign_mesh": ("ForeignBody", "read_foreign"),
    "mesh_file": ("read_mesh", "write_mesh"),
    "scene": (
        "Cavity",
        "Drive",
        "Foundation",
        "Load",
        "Mass",
        "Membrane",
        "Pin",
        "Probe",
        "Scene",
        "DriveShape",
        "Support",
        "Weight",
    ),
    "material": ("Material", "Region"),
    "laws": ("Coefficients",),
    "prony": ("Prony",),
    "rubber": ("mooney_rivlin", "ogden", "yeoh"),
    "material_point": ("MaterialPoint",),
    "rigid_body": ("RigidBody",),
    "box": ("grid",),
    "contact": ("RigidContact", "RigidCylinder", "RigidPlane", "RigidPunch", "RigidSphere"),
    "cylinder": ("quarter_cylinder",),
    "inclusion": ("Block", "Capsule", "block_with_inclusion"),
    "refine": ("refined",),
    "tracked": ("Prescribed",),
    "select": ("InBox", "Labelled", "Nearest", "OnPlane", "Site"),
}

__all__ = names(_HOMES)
__getattr__ = lazily(__name__, _HOMES)
