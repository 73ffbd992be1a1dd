"""Compensation: the inverse of a model computes the drive voltage for a wanted displacement.

`Inverse` is the inverse model. `reachable` and `plan` compute, before anything moves, which part of a path
can be reached and the expected error. `learn` corrects a drive with the measured error.
"""

from .band import Band
from .expected_error import ExpectedError
from .inverse import Inverse, InverseState
from .learning import IterativeLearning, LearningRound, learn
from .learning_filter import LearningFilter, ResponseCheck
from .limit_check import reachable
from .limits import Limits
from .plan import Plan, plan
from .reachability import NearestPath, Reachability, UnreachablePart

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
    "Plan",
    "Reachability",
    "ResponseCheck",
    "UnreachablePart",
    "learn",
    "plan",
    "reachable",
]
