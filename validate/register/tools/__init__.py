"""Tracked tools: calibration of a tip or an image plane, landmarks touched with a tip.

Start with `image_plane`.
"""
