"""Scene -> matrices. scikit-fem assembles; unknowns are node-major (x0 y0 z0 x1 ...)."""
