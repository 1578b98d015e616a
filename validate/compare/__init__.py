"""Comparison: residuals of a run against a recording, scores with units, verdicts with counts."""
