"""Extended Kalman filter by node (paper 003) on the explicit step.

Start with `node_ekf`.
"""
