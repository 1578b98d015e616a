"""Schemes: settings, preparation and step; `march` runs the steps."""

from validate.exports import lazily, names

_HOMES = {
    "types": ("Outcome", "Run", "SceneSolver", "Scheme", "State", "StepTimes", "Stepper", "Trace"),
    "handles": ("Handles", "require_handled"),
    "schemes": ("SCHEMES", "SOLVERS", "schemes_that"),
    "march": ("run_scheme",),
}

__all__ = names(_HOMES)
__getattr__ = lazily(__name__, _HOMES)
