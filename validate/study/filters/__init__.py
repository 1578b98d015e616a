"""Filter study: sweep of filter settings, scores, ranking, choice.

Start with `study`.
"""
