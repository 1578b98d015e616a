"""Scene: declared mesh, materials, supports, drives, cavities, without matrices."""

from validate.exports import lazily, names

_HOMES = {
    "mesh": (
        "Mesh",
        "quadratic",
    ),
    "geometries.tetrahedral_filling": ("filled",),
    "mesh_files.third_party_meshes": (
        "ForeignBody",
        "read_foreign",
    ),
    "mesh_files.mesh_file": (
        "read_mesh",
        "write_mesh",
    ),
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
    "material": (
        "Material",
        "Region",
        "Prony",
    ),
    "laws": ("Coefficients",),
    "rubber": (
        "mooney_rivlin",
        "ogden",
        "yeoh",
    ),
    "meshless": (
        "MaterialPoint",
        "RigidBody",
    ),
    "geometries.box": ("grid",),
    "contact": (
        "RigidContact",
        "RigidCylinder",
        "RigidPlane",
        "RigidPunch",
        "RigidSphere",
    ),
    "geometries.cylinder": ("quarter_cylinder",),
    "geometries.inclusion": (
        "Block",
        "Capsule",
        "block_with_inclusion",
    ),
    "geometries.refinement": ("refined",),
    "prescribed_motion": ("Prescribed",),
    "places": (
        "InBox",
        "Labelled",
        "Nearest",
        "OnPlane",
        "Site",
    ),
}

__all__ = names(_HOMES)
__getattr__ = lazily(__name__, _HOMES)
