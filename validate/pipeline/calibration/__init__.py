"""Identification before prediction: what is free, on which residuals, with what uncertainty.

Start with `calibration`.
"""
