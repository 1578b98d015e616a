"""Explicit dynamics: central difference, linear and at large strain.

Start with `central`.
"""
