"""A rubber strip that is pulled, tracked by two cameras; and the tracker against a stage."""
