"""Trade-off study: error against time per step over solvers, meshes and steps.

Start with `study`.
"""
