"""Outlines of inclusions in images: extracted, tracked, or from third parties.

Start with `outline`.
"""
