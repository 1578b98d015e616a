"""Scene: declared mesh, materials, supports, drives, cavities, without matrices."""

from validate.exports import lazily, names

_HOMES = {
    "mesh": ("Mesh",),
    "mesh_files.mesh_file": ("filled", "read_mesh", "write_mesh"),
    "mesh_files.third_party_meshes": ("ForeignBody", "read_foreign"),
    "scene": (
        "Prescribed",
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
    "material": ("Material", "Region", "Prony"),
    "laws": ("Coefficients",),
    "meshless": ("MaterialPoint", "RigidBody"),
    "geometries.box": ("grid",),
    "contact": ("RigidContact", "RigidCylinder", "RigidPlane", "RigidPunch", "RigidSphere"),
    "geometries.specification": ("quarter_cylinder",),
    "geometries.inclusion": ("Block", "Capsule"),
    "geometries.refinement": ("refined",),
    "places": ("InBox", "Labelled", "Nearest", "OnPlane", "Site"),
}

__all__ = names(_HOMES)
__getattr__ = lazily(__name__, _HOMES)
