"""Outlines of inclusions in images: found, followed, or drawn by others.

Start with `outline`.
"""
