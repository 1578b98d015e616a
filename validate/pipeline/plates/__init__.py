"""Bodies between plates or grips, and blocks with a fluid inclusion.

Start with `compression`.
"""
