"""Linear Kalman filters: formulas, covariance, gains; KF-FEM of paper 001, in nodes and in modes.

Start with `formulas`, then `kf_fem`.
"""
