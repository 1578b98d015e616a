"""Filters: a system and its measurements give an estimate with its uncertainty, never the truth."""
