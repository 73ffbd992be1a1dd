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

"""The time base of a recording: its sample period, and the places where time stands still, jumps or decreases."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import RecordError, RecordingError, counted
from ...record import Notice, Samples

JITTER = 0.02
"""Deviation of the steps from their mean, in sample periods (rms), above which it is reported."""
LONGEST_DELAY = 2.5
"""Step in sample periods up to which it may be a late time, because the times after it are where they would be."""
WINDOW = 8
"""Number of times before and after such a step that decide."""
LARGEST_CONTRADICTION = 0.05
"""Share by which a sample period given by hand may differ from the times of the file."""
IN_A_ROW = 8
"""Number of long steps in a row from which samples are not missing, but were taken at a longer period."""
MUCH = 0.05
"""Share of the time with such steps that makes the finding severe."""
COARSE = 0.05
"""Share of times equal to the one before from which the clock is coarser than the sample period."""


def round_period(period: float, tolerance: float = 1e-12) -> float:
    """The number with the fewest digits within a relative tolerance: recorded times are rounded, clocks are not.

    >>> round_period(2.0000000000000002e-05), round_period(0.004999, 1e-3)
    (2e-05, 0.005)
    """
    for digits in range(1, 17):
        short = float(f"{period:.{digits}g}")
        if abs(short - period) <= tolerance * period:
            return short
    return period


@dataclass(frozen=True, slots=True)
class SlowerPart:
    """Samples that were taken at a longer period than most: begin, end and step [s], number, share of the time."""

    begin: float
    end: float
    step: float
    count: int
    share: float

    @classmethod
    def of(cls, time: Samples, long: NDArray[np.bool_]) -> SlowerPart | None:
        """The samples after `IN_A_ROW` or more long steps in a row; None if there are none."""
        edges = np.flatnonzero(np.diff(long.astype(np.int8), prepend=0, append=0)).reshape(-1, 2)
        runs = [(int(a), int(b)) for a, b in edges if b - a >= IN_A_ROW]
        if not runs:
            return None
        steps = np.concatenate([np.diff(time[a : b + 1]) for a, b in runs])
        share = float(steps.sum()) / abs(float(time[-1] - time[0]))
        return cls(float(time[runs[0][0]]), float(time[runs[-1][1]]), float(np.median(steps)), steps.size, share)

    def notice(self, period: float, phase: str) -> Notice:
        """The finding, with what to do."""
        text = (
            f"{self.count} samples between {self.begin:.6g} and {self.end:.6g} s are about {self.step:.3g} s apart, "
            f"expected {period:g} s as most others; they are not used; read each part with one period by itself, by "
            "`rows`, or sample all at one period"
        )
        return Notice("time_base", text, phase, severe=self.share > MUCH)


@dataclass(frozen=True, eq=False, slots=True)
class TimeColumn:
    """Result of checking a column of times.

    Attributes
    ----------
    period : float
        Time between samples [s].
    breaks : ndarray of int
        Samples before which some are missing or time decreases.
    lost : ndarray of int
        Samples missing before each break; 0 where time decreases.
    jitter : float
        Deviation of the other steps from the period, rms, in periods.
    repeated : ndarray of int
        Samples that have the time of the one before and shift all times after them; nothing is missing there.
    is_coarse : bool
        True if the clock is coarser than the sample period, so that many times are equal.
    slower : SlowerPart, optional
        Samples that were taken at a longer period than most.
    """

    period: float
    breaks: NDArray[np.int64]
    lost: NDArray[np.int64]
    jitter: float
    repeated: NDArray[np.int64]
    is_coarse: bool
    slower: SlowerPart | None = None

    @classmethod
    def of(cls, time: Samples) -> TimeColumn:
        """Read the times of samples.

        Parameters
        ----------
        time : (n,) ndarray
            Time of every sample [s].

        Raises
        ------
        RecordError
            If there are fewer than two times, or they do not increase.
        """
        if time.size < 2:
            raise RecordError("time: got the time of one sample, expected two or more; give `sample_period`")
        steps = np.diff(time)
        forward = steps[steps > 0]
        if not np.isfinite(time).all():
            at = int(np.argmin(np.isfinite(time)))
            raise RecordError(
                f"time: got no number in row {at + 1} of {time.size} rows with data, expected seconds or dates; leave "
                "the row out by `rows`, or give `sample_period`"
            )
        if not forward.size:
            raise RecordError("time: got times that never grow, expected seconds or dates; give `sample_period`")
        # times written with few digits stand still between their steps: then the mean step is used
        is_coarse = int(np.count_nonzero(steps == 0)) > COARSE * steps.size
        usual = 0.0 if is_coarse else float(np.median(steps[steps >= 0]))
        longest = 1.5 * usual if usual > 0 else 3.0 * float(np.min(forward))
        broken = (steps < 0) | (steps > longest)
        repeated = np.zeros(steps.size, np.bool_)
        if usual > 0:
            in_place = _in_place(time, steps, usual)
            broken &= ~in_place
            repeated = (steps == 0) & ~in_place
        whole = steps[~broken & ~repeated]
        mean = float(whole.mean())
        slack = float(np.abs(whole - mean).max() + 4 * np.spacing(np.abs(time).max())) / whole.size
        period = round_period(mean, slack / mean)
        breaks = np.flatnonzero(broken) + 1
        lost = np.maximum(np.rint(steps[broken] / period).astype(np.int64) - 1, 0)
        jitter = float(np.sqrt(np.mean((whole - mean) ** 2))) / period if usual > 0 else 0.0
        lost = np.where(steps[broken] > 0, lost, 0)
        slower = SlowerPart.of(time, broken & (steps > 0))
        return cls(period, breaks, lost, jitter, np.flatnonzero(repeated) + 1, is_coarse, slower)

    @property
    def gaps(self) -> tuple[dict[int, int], dict[int, int]]:
        """The `breaks` and the `pauses` of `split_at_gaps`."""
        breaks = {int(at): int(lost) for at, lost in zip(self.breaks, self.lost, strict=True)}
        return breaks, {int(at): 0 for at in self.repeated}

    def require(self, period: float) -> None:
        """Compare the times with a sample period that was given by hand.

        Parameters
        ----------
        period : float
            Time between the samples as they are kept [s].

        Raises
        ------
        RecordingError
            If they differ by more than `LARGEST_CONTRADICTION`.
        """
        if abs(self.period / period - 1.0) > LARGEST_CONTRADICTION:
            raise RecordingError(
                f"`sample_period`: got {period:g} s, but the times of the file are {self.period:g} s apart; leave "
                "it out, or name the unit of the times by `units`, e.g. time=ms"
            )

    def notices(self, phase: str = "") -> list[Notice]:
        """Findings about the times."""
        message = []
        if self.is_coarse:
            text = (
                "many times are equal, because they are rounded or the clock is coarse; the mean step of "
                f"{self.period:.6g} s is used as sample period; otherwise give `sample_period`"
            )
            message.append(Notice("time_base", text, phase))
        if self.repeated.size:
            places = counted(self.repeated.size, "place")
            text = f"the time of the sample before is repeated at {places}; the state continues"
            message.append(Notice("non_monotonic", text, phase, severe=self.repeated.size > 1))
        if self.jitter > JITTER:
            message.append(
                Notice(
                    "time_base",
                    f"steps of the time base scatter by {100 * self.jitter:.1f} % of the sample period "
                    f"{self.period:g} s; uniform times are assumed; if the "
                    "samples were taken at the times of the file, interpolate all channels at even times before",
                    phase,
                    severe=self.jitter > 0.5,
                )
            )
        if self.slower is not None:
            message.append(self.slower.notice(self.period, phase))
        elif missing := int(self.lost.sum()):
            what = f"{counted(missing, 'sample')} {'is' if missing == 1 else 'are'} missing in "
            message.append(Notice("gap", what + counted(int((self.lost > 0).sum()), "place"), phase))
        if back := int((self.lost == 0).sum()):
            message.append(
                Notice("non_monotonic", f"the time decreases at {counted(back, 'place')}", phase, severe=back > 1)
            )
        return message


def without_duplicates(columns: Mapping[str, Samples]) -> tuple[dict[str, Samples], list[Notice]]:
    """Columns without the rows that repeat the row before in every column, its time among them.

    Parameters
    ----------
    columns : mapping of str to (n,) ndarray
        Channels, and `time`.

    Returns
    -------
    columns : dict of str to ndarray
        As they were where the clock is coarse: then equal rows may be two samples of a stage at rest.
    notices : list of Notice
        ``duplicate`` if rows were dropped.
    """
    still = np.diff(columns["time"]) == 0.0
    if not still.any() or np.count_nonzero(still) > COARSE * still.size:
        return dict(columns), []
    for values in columns.values():
        still &= (values[1:] == values[:-1]) | (np.isnan(values[1:]) & np.isnan(values[:-1]))
    if not (count := int(np.count_nonzero(still))):
        return dict(columns), []
    kept = np.append(True, ~still)
    first = float(columns["time"][1:][still][0])
    what = "1 row repeats the row before and was" if count == 1 else f"{count} rows repeat the row before and were"
    text = f"{what} dropped; the first is at {first:.6g} s"
    return {name: values[kept] for name, values in columns.items()}, [Notice("duplicate", text)]


def _in_place(time: Samples, steps: Samples, usual: float) -> NDArray[np.bool_]:
    """Long or zero steps after which the times are where they would be: those of a busy computer scatter."""
    found = np.zeros(steps.size, np.bool_)
    late = np.flatnonzero((steps == 0) | ((steps > 1.5 * usual) & (steps < LONGEST_DELAY * usual)))
    around = np.arange(1, WINDOW + 1)
    for some in np.array_split(late, 1 + late.size // 10_000):
        before, after = (np.clip(some[:, None] + i, 0, time.size - 1) for i in (1 - around, around))
        shift = np.median(time[after] - usual * after, axis=1) - np.median(time[before] - usual * before, axis=1)
        found[some] = np.abs(shift) < 0.5 * usual
    return found
