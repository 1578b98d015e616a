"""filterpy's filters with this package's checks, and a comparison with its own filters.

Only `classes` imports filterpy.
"""
