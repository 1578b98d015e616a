"""Metrics of two deformed bodies or displacement fields (paper 002).

Start with `two_fields`.
"""
