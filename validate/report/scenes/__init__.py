"""Pictures of the body and of what was measured on it: renders, outlines, markers.

Start with `bodies`.
"""
