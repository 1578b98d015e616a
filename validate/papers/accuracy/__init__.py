"""Paper 002: what explicit steps, lumping and quasi-statics cost in accuracy."""
