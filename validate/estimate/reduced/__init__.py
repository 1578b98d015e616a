"""Filters on reduced models: modes with a load bias, one amplitude, samples of a small state.

Start with `reduced_kf`.
"""
