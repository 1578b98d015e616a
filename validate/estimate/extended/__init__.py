"""The extended Kalman filter of paper 003, node by node, on the explicit step.

Start with `node_ekf`.
"""
