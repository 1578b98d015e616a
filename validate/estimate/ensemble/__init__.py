"""Filters that run several members of a model: ensemble Kalman filter, unscented in parameters.

Start with `ensemble_kf`; `member_filter` steps all of them.
"""
