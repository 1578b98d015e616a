"""Coverage study: error rates of the package's verdicts.

Start with `study`.
"""
