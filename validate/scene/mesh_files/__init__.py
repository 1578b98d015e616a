"""Meshes from files of other programs, each format or library behind one module.

Start with `third_party_meshes`.
"""
