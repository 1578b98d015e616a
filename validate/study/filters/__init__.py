"""Which filter setting is best on a recording: sweep, scores, ranking, choice.

Start with `study`.
"""
