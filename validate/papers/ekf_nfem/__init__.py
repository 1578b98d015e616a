"""Paper 003: an extended Kalman filter on nonlinear elements, a cube, a liver and a cone."""
