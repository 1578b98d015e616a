"""Charts as figures: axes, line styles, heat maps, intervals.

Start with `chart`.
"""
