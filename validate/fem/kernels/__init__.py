"""Compiled element loops: forces, tangents and steps at real-time rate.

Start with `explicit`, which chooses the loop of a body.
"""
