"""Recordings: what was measured, with units, clocks, calibration and provenance.

The only floor that knows file formats. `types` holds what every reader returns.
"""
