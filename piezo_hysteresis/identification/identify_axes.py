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

"""`identify_axes`: a full matrix of dynamics with a hysteresis for every actuator, from records of several axes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import IdentificationError
from ..model.axes_model import LINEAR_TERMS, AxesModel
from ..model.axes_samples import columns, names
from ..record import Record
from .axes_equations import Regression, impulse_responses, require_samples

Array = NDArray[np.float64]

LENGTH = 250
"""Number of taps of every impulse response."""
PASSES = 3
"""Number of passes: a linear one and two with hysteresis; a further one reduces the error by about 1 %."""
RADII = (0.05, 0.2, 0.8)
"""Half widths of the play operators, in units of the rms elongation."""
MEMORY = 0.05
"""Time constant of the running mean square [s]."""


@dataclass(frozen=True, slots=True)
class AxisError:
    """Free-run error of one displacement in one record.

    Parameters
    ----------
    phase : str
        Phase of the record.
    displacement : str
        Name of the channel.
    rms : float
        RMS error about its mean [m].
    percent : float
        RMS error in per cent of the peak-to-peak displacement of the axis over all records.
    """

    phase: str
    displacement: str
    rms: float
    percent: float


def fitted_from(record: Record, settling: int) -> int:
    """First sample that counts: 0 if the record begins at 0 V, otherwise the first one after the settling."""
    return settling if record.truncated or record.continues else 0


def identify_axes(
    records: Sequence[Record],
    length: int = LENGTH,
    radii: Sequence[float] = RADII,
    passes: int = PASSES,
    progress: Callable[[str], None] | None = None,
) -> AxesModel:
    """Fit the taps in several passes, each by linear least squares with the prediction of the pass before.

    Parameters
    ----------
    records : sequence of Record
        Records with channels ``voltage_2``, ``displacement_2``, …, all at one sample period. A record begins at rest at
        0 V, unless it is `truncated` or `continues`; then its beginning only determines the state of the model.
    length : int
        Number of taps of every response.
    radii : sequence of float
        Half widths of the plays in units of the rms elongation.
    passes : int
        Number of passes; 1 for a model without hysteresis.
    progress : callable, optional
        Called with a line of text before every pass.

    Returns
    -------
    AxesModel
        Model that computes all displacements from the voltages alone.

    Raises
    ------
    IdentificationError
        If the records have other channels or periods than the first, or do not determine the taps.
    """
    if length < 1 or passes < 1:
        raise IdentificationError(f"got {length} taps and {passes} passes, expected 1 or more of each")
    voltages, displacements = _checked(records)
    inputs, outputs = voltages[0].shape[1], displacements[0].shape[1]
    reference = float(np.sqrt(np.mean(np.concatenate(voltages) ** 2)))
    if reference == 0.0:
        raise IdentificationError("all drive voltages are 0 V, expected records with independent noise on every drive")
    terms = inputs * (LINEAR_TERMS + len(radii))
    require_samples(sum(map(len, voltages)), length * LINEAR_TERMS * inputs)  # before arrays of that length
    model = AxesModel(
        np.zeros((1, outputs, length, terms)), np.zeros((inputs, outputs)), np.zeros(len(radii)), np.zeros(outputs),
        records[0].sample_period, reference, MEMORY,
    )  # fmt: skip
    spread = [max(float(y.std()), np.finfo(float).tiny) for y in displacements]
    weights = [(min(spread) / s) ** 2 for s in spread]  # records are weighted by their relative error
    scales = np.asarray(radii, dtype=np.float64)
    for number in range(passes):
        if progress is not None:
            progress(f"pass {number + 1} of {passes}")
        used = LINEAR_TERMS * inputs if number == 0 else terms
        settling = int(replace(model, taps=np.zeros((passes, *model.taps.shape[1:]))).settling)
        parts = [
            Regression(model.regressors(u)[:, :used], y, fitted_from(record, settling), weight)
            for record, u, y, weight in zip(records, voltages, displacements, weights, strict=True)
        ]
        # a play wider than its elongation never moves; of fewer displacements than drives some elongations are small
        moving = [j for j in range(used) if j < LINEAR_TERMS * inputs or any(part.x[:, j].any() for part in parts)]
        h, zero = impulse_responses([replace(part, x=part.x[:, moving]) for part in parts], length)
        taps = model.taps.copy()
        taps[-1][:, :, moving] = h
        model = replace(model, taps=taps, zero=zero)
        if number == 0:
            static = taps[0].sum(axis=1)[:, : LINEAR_TERMS * inputs].reshape(outputs, LINEAR_TERMS, inputs).sum(axis=1)
            elongation = np.linalg.pinv(static)
            motions = [(y - y.mean(axis=0)) @ elongation.T for y in displacements]
            size = float(np.sqrt(np.mean(np.concatenate(motions) ** 2)))
            model = replace(model, elongation=elongation, radii=scales * size)
        if number < passes - 1:
            model = replace(model, taps=np.concatenate((model.taps, np.zeros((1, *model.taps.shape[1:])))))
    return replace(model, level_max=max(float(model.levels(u).max()) for u in voltages))


def axes_errors(model: AxesModel, records: Sequence[Record]) -> list[AxisError]:
    """Free-run error of every displacement of every record; without the settling, if a record does not begin at rest.

    Raises
    ------
    IdentificationError
        If a record has other channels or another sample period than the model, or ends before the model has settled.
    """
    errors, lows, highs = [], [], []
    for record, u, y in zip(records, *_checked(records), strict=True):
        if (u.shape[1], y.shape[1]) != (model.inputs, model.outputs):
            raise IdentificationError(
                f"{record.phase}: got {u.shape[1]} drives and {y.shape[1]} displacements, "
                f"expected {model.inputs} and {model.outputs} as the model has"
            )
        if not np.isclose(record.sample_period, model.sample_period, rtol=1e-3):
            raise IdentificationError(
                f"{record.phase}: got the sample period {record.sample_period:g} s, expected {model.sample_period:g} s"
            )
        first = fitted_from(record, model.settling)
        if first >= len(y):
            raise IdentificationError(
                f"{record.phase}: got {len(y)} samples, expected more than {first}; record longer"
            )
        errors.append((y - model.run(u, model.rest())[0])[first:].std(axis=0).tolist())
        lows.append(y[first:].min(axis=0))
        highs.append(y[first:].max(axis=0))
    ranges = (np.max(highs, axis=0) - np.min(lows, axis=0)).tolist()
    return [
        AxisError(record.phase, name, rms, 100.0 * rms / reach if reach else float("inf"))
        for record, own in zip(records, errors, strict=True)
        for name, rms, reach in zip(names(record, "displacement"), own, ranges, strict=True)
    ]


def _checked(records: Sequence[Record]) -> tuple[list[Array], list[Array]]:
    first = records[0]
    for number, record in enumerate(records, 1):
        for quantity in ("voltage", "displacement"):
            if names(record, quantity) != names(first, quantity):
                raise IdentificationError(
                    f"record {number} ({record.phase}): got {', '.join(names(record, quantity))}, expected "
                    f"{', '.join(names(first, quantity))} as in record 1 ({first.phase})"
                )
        if not np.isclose(record.sample_period, first.sample_period, rtol=1e-3):
            raise IdentificationError(
                f"{record.phase}: got the sample period {record.sample_period:g} s, expected {first.sample_period:g} s "
                "as in the first record; identify several axes at one period"
            )
    return [columns(r, "voltage") for r in records], [columns(r, "displacement") for r in records]
