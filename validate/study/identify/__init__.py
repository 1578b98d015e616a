"""Identification study: parameters from a recording with profiles and correlations.

Start with `study`.
"""
