"""Filters with several model members: ensemble Kalman filter, unscented in parameters.

Start with `ensemble_kf`; `member_filter` steps all of them.
"""
