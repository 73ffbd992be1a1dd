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

"""`Roles`: the purpose of every record of an experiment, found from its phase name or from its drive."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from ...errors import RecordError
from ...record import CONDITIONING, Experiment
from .excitation_content import MOVES, ExcitationContent, excitation_content
from .noise import voltage_noise

HELD_OUT = ("validation",)
"""Phases that are not fitted by default."""
LARGE = 0.5
"""Drive range of a slow record, as a share of the largest one, from which the record counts as loops."""

ALSO_SLOW = 4.0
"""Largest ratio of the bandwidth of a drive to that of the slowest, if both count as loops because none is slow."""


@dataclass(frozen=True, eq=False, slots=True)
class Roles:
    """Indices of the records of an experiment by purpose.

    Parameters
    ----------
    contents : tuple of ExcitationContent
        What the drive of every record excites.
    fitted : tuple of int
        Records that the joint fit uses.
    held_out : tuple of int
        Records that are not fitted; the model is tested on them.
    loops : tuple of int
        Slow records with large loops. On them the dynamics are only a gain and a lag, so they show the hysteresis.
        If none is slow, the slower ones without noise and steps, which show the dynamics as much as the loop.
    broadband : tuple of int
        Records at the fastest sample period whose drive determines linear dynamics.
    """

    contents: tuple[ExcitationContent, ...]
    fitted: tuple[int, ...]
    held_out: tuple[int, ...]
    loops: tuple[int, ...]
    broadband: tuple[int, ...]


def roles_of(experiment: Experiment, held_out: Collection[str] = HELD_OUT) -> Roles:
    """Purpose of every record of an experiment.

    Parameters
    ----------
    experiment : Experiment
        All its records.
    held_out : collection of str
        Names of phases that are not fitted.

    Raises
    ------
    RecordError
        If a phase of `held_out` is missing in the experiment (except `HELD_OUT`), or no record is left to fit.
    """
    contents = tuple(excitation_content(r) for r in experiment)
    out = _held_out(experiment, held_out)
    left = [i for i in range(len(experiment)) if i not in out]
    known = [i for i in left if not experiment[i].is_named(CONDITIONING) and not experiment[i].truncated]
    fitted = known if any(contents[i].span > 0.0 for i in known) else left
    largest = max((contents[i].span for i in fitted), default=0.0)
    moving = [i for i in fitted if contents[i].span >= LARGE * largest > 0.0]
    slow = [i for i in moving if contents[i].is_slow]
    smooth = [i for i in moving if not (contents[i].is_broadband or contents[i].is_step)]
    slowest = min((contents[i].bandwidth for i in smooth), default=0.0)
    slower = [i for i in smooth if contents[i].bandwidth <= ALSO_SLOW * slowest]
    straight = [i for i in fitted if experiment[i].phase.split("_")[0] == "triangle"]
    triangles = [i for i in slow if i in straight]
    fastest = experiment.fastest_period
    # a triangle has few turning points and straight lines between them
    rich = [i for i in fitted if contents[i].is_broadband and i not in straight]
    # the stage has not seen the noise of a measured voltage, which is all that a rest contains
    least = MOVES * largest * (voltage_noise(experiment.records) > 0.0)
    rich = [i for i in rich if contents[i].span >= least[i]]
    broadband = [i for i in rich if experiment[i].sample_period < 1.001 * fastest]
    return Roles(contents, tuple(fitted), out, tuple(triangles or slow or slower or moving), tuple(broadband))


def _held_out(experiment: Experiment, phases: Collection[str]) -> tuple[int, ...]:
    """Indices of the records that are not fitted: none if those of `HELD_OUT` are all there are."""
    names = ", ".join(dict.fromkeys(r.phase for r in experiment))
    for phase in phases:
        if phase not in HELD_OUT and not experiment.named(phase):
            raise RecordError(f"held_out: got phase '{phase}', expected some of {names}")
    out = tuple(i for i, record in enumerate(experiment) if record.is_named(*phases))
    if len(out) < len(experiment):
        return out
    if not set(phases) <= set(HELD_OUT):
        raise RecordError(f"held_out: got every phase ({names}), expected at least one that is fitted")
    return ()
