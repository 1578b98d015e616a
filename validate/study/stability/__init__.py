"""Where schemes stay stable: step, material, damping; the gain of a pressure loop.

Start with `study`.
"""
