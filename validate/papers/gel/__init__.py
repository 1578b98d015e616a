"""Particles in a gel before and after indentation (FranckLab/SerialTrack)."""
