# Copyright 2026 piezo_hysteresis maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Compensation: the inverse of a model computes the drive voltage for a wanted displacement.

`Inverse` is the inverse model. `reachable` and `plan` compute which part of a path can be reached, and which error is
expected, before the stage moves. `learn` corrects a drive by the measured error.
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
