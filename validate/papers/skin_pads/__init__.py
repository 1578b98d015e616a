"""Skin in vivo pulled between two pads: tracked points, pad force in a unit nobody stated."""
