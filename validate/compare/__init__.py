"""Comparison: residuals of a run against a recording, scores with units, verdicts with counts."""

from validate.exports import lazily, names

_HOMES = {
    "residual": ("Residual",),
    "convergence": (
        "GridConvergence",
        "Numerical",
        "convergence",
    ),
    "score": (
        "Metric",
        "Score",
        "scores_of",
    ),
    "verdict": (
        "Accept",
        "Check",
        "Sensitivity",
        "judge",
    ),
    "published": (
        "Figure",
        "Published",
    ),
    "effects": (
        "Declared",
        "Effect",
        "Joint",
        "Sensor",
    ),
    "shapes.two_fields": ("FieldScores",),
    "force_error": ("ForcePair",),
    "shapes.pair": ("outline_boundary",),
    "shapes.shape_error": ("Boundaries",),
    "overall_verdict": (
        "Overall",
        "judge_all",
        "Expected",
    ),
    "result": (
        "MethodResult",
        "Result",
    ),
    "exhibit": (
        "ImageSeries",
        "Chart",
        "Exhibit",
        "NodeMap",
        "NumberTable",
        "Picture",
        "Series",
    ),
}

__all__ = names(_HOMES)
__getattr__ = lazily(__name__, _HOMES)
