"""Times of streams: what they look like, and how two clocks are brought together.

Start with `alignment`.
"""
