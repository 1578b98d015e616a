"""Choice of the cheapest method that meets an error and a rate.

Start with `study`.
"""
