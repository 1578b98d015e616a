"""Verdicts of the accepted methods, and likely causes of differences.

Start with `checks`.
"""
