"""Verdicts of the accepted methods, and what makes a difference plausible.

Start with `checks`.
"""
