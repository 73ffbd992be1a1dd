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

"""`TrainingData`: the records for fitting and choosing, and their ranges; `choose_test_records` picks the others."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...blocks.block import Array
from ...effects.extent import MAINS, Extent
from ...model.model import Model
from ...record import Record
from ..fit.normal_equations import Nuisance
from ..free_run_error import free_per_record
from ..records.conditioning import with_conditioning
from ..records.excitation_check import moves
from ..records.excitation_content import excitation_content
from ..records.leading_step import step_length
from .mains_frequency import mains_frequency

PER_TEST_RECORD = 3
"""Number of records of a kind per test record."""
LEVELS_APART = 0.05
"""Smallest difference between two initial levels of records, as a share of the voltage range."""
MOST_PEAKS = 3
"""Largest number of peaks in the residual from which a resonance starts."""
MOVES = 30.0
"""Power over noise from which the spectrum of the displacement counts as motion."""
BLOCKS = 16
"""Approximate number of blocks into which the records are cut."""
FEWEST = 256
"""Smallest number of samples in a block."""


@dataclass(frozen=True, eq=False)
class TrainingData:
    """Records for fitting and choosing, with their floors.

    Parameters
    ----------
    records : tuple of Record
        In experiment order.
    floors : (r,) ndarray
        Floor of every record [m]; infinite for a record that only determines the state of the stage.
    extent : Extent
        Ranges that the records cover.
    alone : tuple of int
        Indices of records that are the only ones of their kind or alone determine a parameter; never left out.
    start : Model, optional
        The model before any joint fit; its hysteresis was fitted to slow records only.
    noise : (r,) ndarray, optional
        Noise of every record [m]; equal to the floors by default.
    offset : bool
        Whether the sensor zero is free in every record.
    """

    records: tuple[Record, ...]
    floors: Array
    extent: Extent
    alone: tuple[int, ...] = ()
    start: Model | None = None
    noise: Array | None = None
    offset: bool = False

    @property
    def begins_at_levels(self) -> bool:
        """Whether the stage had settled at more than one level, so that settling at rest can be determined."""
        levels = [r.settled_voltage for r in self.records if not r.continues]
        return bool(levels) and max(levels) - min(levels) > LEVELS_APART * self.extent.span

    @property
    def null(self) -> float:
        """V of a perfect model: mean squared ratio of noise to floor."""
        noise, counted = self.floors if self.noise is None else self.noise, np.isfinite(self.floors)
        return float(np.mean((noise[counted] / self.floors[counted]) ** 2))

    def free_with(self, model: Model) -> Nuisance:
        """The disturbances that are free in every record for a model."""
        return free_per_record(model, offset=self.offset)

    @cached_property
    def broadband(self) -> list[int]:
        """Records whose drive determines linear dynamics."""
        return [
            i
            for i, (r, f) in enumerate(zip(self.records, self.floors, strict=True))
            if np.isfinite(f)
            and r.sample_period < 1.001 * self.extent.fastest_period
            and excitation_content(r).is_broadband
        ]

    def with_lines(self, left: Sequence[Array]) -> TrainingData:
        """The same data with the frequencies of peaks and of the mains in the residuals `left` of the records."""
        counted = [i for i, floor in enumerate(self.floors) if np.isfinite(floor)]
        records, left = [self.records[i] for i in counted], [left[i] for i in counted]
        mains = tuple(mains_frequency(nominal, records, left, self.floors[counted]) for nominal in MAINS)
        return replace(self, extent=replace(self.extent, peaks=peaks_of(records, left), mains=mains))


def peaks_of(records: Sequence[Record], left: Sequence[Array]) -> tuple[float, ...]:
    """Frequencies with the largest ratio of residual to displacement [Hz], as start values of a resonance.

    Only frequencies are used at which the motion is well above the noise at the top of the band.
    """
    period = min(r.sample_period for r in records)
    grid = np.geomspace(20.0, 0.45 / period, 200)
    power, reach, lines = np.zeros(grid.size), np.zeros(grid.size), np.zeros(grid.size)
    for record, e in zip(records, left, strict=True):
        if record.sample_period > 1.001 * period or e.size < 256:
            continue
        window = np.hanning(e.size)
        index = np.searchsorted(grid, np.fft.rfftfreq(e.size, record.sample_period))
        inside = (index > 0) & (index < grid.size)
        lines += np.bincount(index[inside], minlength=grid.size)
        for total, signal in ((power, e), (reach, record.displacement)):
            spectrum = np.abs(np.fft.rfft(window * (signal - signal.mean()))) ** 2 / e.size
            total += np.bincount(index[inside], spectrum[inside], grid.size)
    held = lines > 0
    if held.sum() < 8:
        return ()
    frequency, power, reach = grid[held], power[held] / lines[held], reach[held] / lines[held]
    noise = float(np.median(power[frequency > 0.3 / period]))
    ratio = np.where(reach > MOVES * noise, np.maximum(power - noise, 0.0) / reach, 0.0)
    tops = 1 + np.flatnonzero((ratio[1:-1] > ratio[:-2]) & (ratio[1:-1] >= ratio[2:]))
    return tuple(float(frequency[k]) for k in tops[np.argsort(-ratio[tops])][:MOST_PEAKS])


def training_data_of(
    records: Sequence[Record], fitted: Collection[int], noise: Array, least: Array, model: Model
) -> TrainingData:
    """The blocks of the records `fitted`, a leading jump apart, with a zero in each of several records.

    `noise` and `least` are noise and floor of every record [m], shape (r,). Records that only set the state stay whole
    and have an infinite floor; others are left out. The ranges are in the units of `model`.
    """
    length = max(FEWEST, sum(records[i].size for i in fitted) // BLOCKS)
    blocks, jumps = list[tuple[Record, float, float]](), list[int]()
    for index in with_conditioning(records, fitted):
        record = records[index]
        if index not in fitted:
            blocks.append((record, np.inf, np.inf))
            continue
        step = 0 if record.continues else step_length(record)
        if step:
            jumps.append(len(blocks))
        count = max(1, round((record.size - step) / length))
        edges = {step, *(step + round(k * (record.size - step) / count) for k in range(1, count))}
        blocks += [(block, least[index], noise[index]) for block in record.split(*sorted(edges - {0}))]
    cut, weights, quiet = zip(*blocks, strict=True)
    extent = Extent.of([records[i] for i in fitted], model.voltage_scale, model.displacement_scale)
    several = sum(not r.continues for r in records) > 1
    return TrainingData(cut, np.array(weights), extent, tuple(jumps), noise=np.array(quiet), offset=several)


def choose_test_records(records: Sequence[Record], usable: Collection[int]) -> tuple[int, ...]:
    """Indices of the test records, of those that are `usable`.

    If a kind of phase has at least three realisations, one in three is a test record, from the middle of the list, so
    that the extremes of amplitude and frequency are fitted. All phases named ``validation`` are test records, unless
    the drive moves in no other record.
    """
    kinds: dict[str, list[int]] = {}
    for index in usable:
        kinds.setdefault(records[index].phase.split("_")[0], []).append(index)
    validation = kinds.pop("validation", [])
    if not any(moves(records[i]) for members in kinds.values() for i in members):
        return ()
    chosen = [
        i
        for members in kinds.values()
        for i in members[PER_TEST_RECORD // 2 :: PER_TEST_RECORD][: len(members) // PER_TEST_RECORD]
    ]
    return tuple(sorted(chosen + validation))
