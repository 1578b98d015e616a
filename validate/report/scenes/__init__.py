"""Figures of the body and its measurements: renders, outlines, markers.

Start with `bodies`.
"""
