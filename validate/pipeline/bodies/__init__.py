"""Measured bodies of any shape: mesh, drive, markers and motion.

Start with `measured`.
"""
