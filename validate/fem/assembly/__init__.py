"""Assembly of a linear body by scikit-fem, and interpolation at points.

Start with `assemble`.
"""
