"""Filters on reduced models: modes with a load bias, one amplitude, shapes at large strain.

Start with `reduced_kf`.
"""
