"""Verdicts of the accepted methods, their sentence, likely causes of differences, plausible inputs.

Start with `checks`.
"""
