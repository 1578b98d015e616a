"""Rubbers and gels pulled in several modes: stress against stretch, digitised from publications."""
