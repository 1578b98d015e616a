"""Direct factorisation and condensation of sparse systems.

Start with `factor`, the one place that chooses a solver.
"""
