"""replay.mcap: measurement and simulation in one timeline for viewers.

Start with `mcap`.
"""
