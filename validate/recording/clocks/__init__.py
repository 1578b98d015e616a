"""Time stamps of streams, and synchronisation of two clocks.

Start with `alignment`.
"""
