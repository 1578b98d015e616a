"""Charts as pictures: axes, looks, heats, intervals.

Start with `chart`.
"""
