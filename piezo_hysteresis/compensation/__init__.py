"""Compensation: a model turned round drives the stage where it should go.

`Inverse` is the model turned round; `reachable` and `plan` say what can be had and how well, before anything moves;
`learn` corrects a drive by what was measured.
"""

from .band import Band
from .expected_error import ExpectedError, ParameterCovariance
from .inverse import Inverse, InverseState
from .limits import Limits
from .plan import Plan, plan
from .reachability import NearestPath, Reachability, UnreachablePart
from .reachable import reachable

__all__ = [
    "Band",
    "ExpectedError",
    "Inverse",
    "InverseState",
    "Limits",
    "NearestPath",
    "ParameterCovariance",
    "Plan",
    "Reachability",
    "UnreachablePart",
    "plan",
    "reachable",
]
