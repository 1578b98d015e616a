"""Comparison and summary of stored runs, without new runs.

Start with `score_comparison`.
"""
