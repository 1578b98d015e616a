"""Paper 000, section 3.3: a planar block with cavities, its pressure-volume curve and updates."""
