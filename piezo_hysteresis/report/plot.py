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

"""`plot`: the figure of a record, an experiment, a model with an experiment, an identification or a diagnosis."""

from __future__ import annotations

from ..discrepancy import Diagnosis
from ..errors import RecordError
from ..identification.free_run_error import free_per_record
from ..identification.identification import Identification
from ..model.model import Model
from ..record import Experiment, Record
from .figures.comparison import compare, compare_diagnosis
from .figures.diagnosis.gap import gap
from .figures.drawing import Drawing
from .figures.preview import preview
from .figures.time_series import time_series


def plot(
    what: Record | Experiment | Model | Identification | Diagnosis, experiment: Experiment | None = None
) -> Drawing:
    """The overview figure of `what`. A notebook shows it, and `Drawing.save_picture` writes it.

    `Record.plot`, `Experiment.plot`, `Model.plot`, `Identification.plot` and `Diagnosis.plot` call this function.
    matplotlib is imported with the first figure.

    Parameters
    ----------
    what : Record, Experiment, Model, Identification or Diagnosis
        Records are drawn against time and as loops; a model or an identification together with an experiment, with the
        residual and the 95 % band of the prediction; a diagnosis as the gap before and after.
    experiment : Experiment, optional
        Experiment for a model or an identification; the state continues from phase to phase.

    Returns
    -------
    Drawing
        Caption, data and a `matplotlib` figure.

    Raises
    ------
    RecordError
        If a model is given without an experiment, or a diagnosis has nothing to draw.
    """
    if isinstance(what, Record):
        return preview(Experiment((what,)))
    if isinstance(what, Experiment):
        return preview(what)
    if isinstance(what, Diagnosis):
        drawing = gap(compare_diagnosis(what))
        if drawing is None:
            raise RecordError("plot: got a diagnosis without a model, expected one with a gap; see its reason")
        return drawing
    model = what.model if isinstance(what, Identification) else what
    if experiment is None:
        raise RecordError("plot: got a model alone, expected an experiment too; give plot(model, experiment)")
    return time_series(
        compare(experiment, {"model": model}, {"model": free_per_record(model, offset=True)}, with_band=True)
    )
