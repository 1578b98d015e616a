"""Stability study: limits of schemes by step, material, damping; gain of a pressure loop.

Start with `study`.
"""
