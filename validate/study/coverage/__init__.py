"""How often the verdicts of the package are wrong.

Start with `study`.
"""
