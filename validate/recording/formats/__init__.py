"""Formats of other programs, each by its library behind one file."""
