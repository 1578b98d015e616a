"""Result folders: written, replaced, compared with earlier ones, read again.

Start with `folder`.
"""
