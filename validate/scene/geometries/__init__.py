"""Geometries of bodies and the meshes made from them.

Start with `specification`.
"""
