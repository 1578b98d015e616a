"""Implicit dynamics: Newmark, modal superposition, Newton.

Start with `newmark`; `linear` holds what linear schemes share.
"""
