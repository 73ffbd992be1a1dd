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

"""The published steps as far as the records permit them; what is missing becomes a notice."""

from __future__ import annotations

from ..effects import HysteresisOperator
from ..errors import IdentificationError
from ..record import Experiment, Notice
from .records.leading_step import begins_with_a_jump
from .records.roles import Roles
from .steps.delay import Delay, identify_delay
from .steps.three_steps import ThreeSteps, three_steps

LEADING_STEP = (
    "the step is at the first sample, so the delay cannot be read from its onset; the joint fit determines delay, "
    "ringing and creep from it"
)
"""Message if the only step is at the beginning of a record."""


def delay_of_steps(experiment: Experiment, roles: Roles, notices: list[Notice]) -> Delay | None:
    """Delay from the steps of an experiment; None, with a notice, if it has none.

    Parameters
    ----------
    experiment : Experiment
        Records of any kind.
    roles : Roles
        What each record is used for.
    notices : list of Notice
        Findings are added.
    """
    at_full_rate = [i for i in roles.fitted if experiment[i].sample_period < 1.001 * experiment.fastest_period]
    fast = [experiment[i] for i in at_full_rate]
    calm = [experiment[i] for i in at_full_rate if not roles.contents[i].is_broadband]
    kinds = (("step",), ("steps", "staircase"))
    named = ([r for r in fast if r.phase.split("_")[0] in kind] for kind in kinds)
    try:
        delay = identify_delay(next((records for records in named if records), calm or fast))
    except IdentificationError as error:
        jumps = any(not r.continues and begins_with_a_jump(r) for r in experiment)
        notices.append(Notice("no_step", LEADING_STEP if jumps else str(error), "step"))
        return None
    notices += delay.notices
    return delay


def published_steps(
    experiment: Experiment,
    voltage_scale: float,
    displacement_scale: float,
    orders: tuple[int, int],
    hysteresis: type[HysteresisOperator],
    delay: Delay | None,
    notices: list[Notice],
) -> ThreeSteps | None:
    """Model of the three published steps; None, with a notice, if a step has no data.

    Parameters
    ----------
    experiment : Experiment
        Records of any kind.
    voltage_scale, displacement_scale : float
        Scales of the model [V, m].
    orders : (int, int)
        na and nb of the ARX model.
    hysteresis : type of HysteresisOperator
        Hysteresis operator.
    delay : Delay or None
        Delay, if it is known.
    notices : list of Notice
        Findings are added.
    """
    try:
        return three_steps(
            experiment.records,
            voltage_scale=voltage_scale,
            displacement_scale=displacement_scale,
            orders=orders,
            hysteresis=hysteresis,
            delay=delay,
        )
    except IdentificationError as error:
        notices.append(Notice("no_three_steps", str(error)))
        return None
