"""Compensation: a model turned round drives the stage where it should go.

`Inverse` is the model turned round; `reachable` and `plan` say what can be had and how well, before anything moves;
`learn` corrects a drive by what was measured.
"""

from .band import Band
from .expected_error import ExpectedError, ParameterCovariance
from .inverse import Inverse, InverseState
from .learning import IterativeLearning, LearningRound, learn
from .learning_filter import LearningFilter, ResponseCheck
from .limits import Limits
from .plan import Plan, plan
from .reachability import NearestPath, Reachability, UnreachablePart
from .reachable import reachable

__all__ = [
    "Band",
    "ExpectedError",
    "Inverse",
    "InverseState",
    "IterativeLearning",
    "LearningFilter",
    "LearningRound",
    "Limits",
    "NearestPath",
    "ParameterCovariance",
    "Plan",
    "Reachability",
    "ResponseCheck",
    "UnreachablePart",
    "learn",
    "plan",
    "reachable",
]
