"""Linear Kalman filters: formulas, covariance, gains; KF-FEM of paper 001 by node and by mode.

Start with `formulas`, then `kf_fem`.
"""
