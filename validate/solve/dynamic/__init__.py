"""Implicit dynamics: Newmark, modes, Newton in time.

Start with `newmark`; `linear` holds what linear schemes share.
"""
