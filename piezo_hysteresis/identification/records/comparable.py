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

"""`comparable`: an experiment as it is compared with a model."""

from __future__ import annotations

from ...record import Experiment, Notice
from .conditioning_split import known_from_within
from .noise import without_voltage_noise
from .one_axis import one_axis


def comparable(experiment: Experiment) -> tuple[Experiment, tuple[Notice, ...]]:
    """The experiment without the noise of its measured voltage, from where the state of the stage is known.

    Parameters
    ----------
    experiment : Experiment
        Experiment as recorded.

    Returns
    -------
    experiment : Experiment
        Experiment with the same samples of displacement.
    notices : tuple of Notice
        Those of `one_axis`, of `known_from_within` and of `without_voltage_noise`.

    Raises
    ------
    RecordError
        If a record has several drives.
    """
    axes = one_axis(experiment)
    known, conditioned = known_from_within(experiment)
    quiet, noise = without_voltage_noise(known)
    return quiet, (*axes, *conditioned, *noise)
