"""Stored runs side by side, and statements over all of them; nothing is run.

Start with `score_comparison`.
"""
