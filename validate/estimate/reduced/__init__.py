"""Filters on few shapes: modes with a load bias, one amplitude, samples of a small state.

Start with `reduced_kf`.
"""
