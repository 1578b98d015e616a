"""Calibration before prediction: free parameters, their data and their uncertainty.

Start with `calibration`.
"""
