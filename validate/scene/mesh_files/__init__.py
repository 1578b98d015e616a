"""Third-party mesh files, each format or library behind one module.

Start with `third_party_meshes`.
"""
