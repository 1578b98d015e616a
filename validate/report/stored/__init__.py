"""Folders of results: written, exchanged, compared with what was there, read again.

Start with `folder`.
"""
