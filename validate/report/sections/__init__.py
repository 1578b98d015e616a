"""Sections of the report page, in their order.

Start with `sections`.
"""
