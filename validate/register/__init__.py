"""Registration: where measured points lie in the model's frame, and how sure that is.

Transforms are named T_target_from_source; residuals are mapped source minus target; metres inside,
millimetres in messages. Fit on the rest state once, then freeze.
"""

from validate.register.quality import Method, Registration, register_points
from validate.register.transform import Similarity, fit_rigid, fit_similarity
from validate.register.two_step import fit_two_step

__all__ = [
    "Method",
    "Registration",
    "Similarity",
    "fit_rigid",
    "fit_similarity",
    "fit_two_step",
    "register_points",
]
