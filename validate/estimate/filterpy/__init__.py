"""filterpy's filters behind our checks, and our filters beside them.

Only `names` imports filterpy.
"""
