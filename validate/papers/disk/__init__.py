"""A disk of known diameter in B-mode images."""
