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

"""Step 1: the delay, from the onset of the step response (paper, Sec. 3.2)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import scipy

from ...errors import IdentificationError, counted
from ...record import Notice, Record
from .step_response import StepResponse, step_response

SURE = 5.0
"""A sample that exceeds this many standard deviations of the noise belongs to the response."""
LIKELY = 2.0
"""Standard deviations that suffice if the samples after it extrapolate to the same onset."""


@dataclass(frozen=True, slots=True)
class Onset:
    """First responding sample at one sample time, and the interval of time in which the response began.

    Parameters
    ----------
    sample_period : float
        Sample time [s].
    samples : int
        Delay d in samples of that time.
    earliest, latest : float
        The response began after `earliest` and not later than `latest` [s].
    """

    sample_period: float
    samples: int
    earliest: float
    latest: float


@dataclass(frozen=True, eq=False, slots=True)
class Delay:
    """Delay of the stage, estimated at several sample times.

    Parameters
    ----------
    samples : int
        Delay d of Eq. (4) at the finest sample period.
    onsets : tuple of Onset
        Onset at each sample time, the finest first.
    response : StepResponse
        Averaged step response at the finest sample period.
    notices : tuple of Notice
        Limits of the estimate: ``delay_ambiguous``, ``delay_inconsistent``, ``delay_unresolved``.
    """

    samples: int
    onsets: tuple[Onset, ...]
    response: StepResponse
    notices: tuple[Notice, ...] = ()

    @property
    def sample_period(self) -> float:
        """Sample period of `samples` [s]."""
        return self.response.sample_period

    @property
    def time(self) -> float:
        """Delay [s]."""
        return self.samples * self.sample_period

    def __str__(self) -> str:
        first = self.onsets[0]
        span = f"{first.earliest * 1e6:.4g} to {first.latest * 1e6:.4g} µs"
        return (
            f"delay {counted(self.samples, 'sample')} of {self.sample_period * 1e6:.4g} µs "
            f"({span}, from {counted(self.response.edges, 'edge')})"
        )


def _onset(response: StepResponse) -> tuple[int, float, float, list[str]]:
    """First responding sample, its interval in samples, and the kinds of notices about its uncertainty."""
    mean = response.mean * np.sign(response.mean[np.argmax(np.abs(response.mean))])
    threshold = float(scipy.stats.t.isf(scipy.stats.norm.sf(SURE), response.freedom))
    beyond = mean > threshold * response.deviation
    sure = beyond & np.append(beyond[1:], True)
    if not sure.any():
        raise IdentificationError(
            f"delay: no sample of the averaged step response exceeds {threshold:.2g} standard deviations of the noise; "
            "use higher steps or more of them"
        )
    onset = int(np.argmax(sure))
    doubtful_notices = []
    earliest = onset - 1
    while onset > 0 and onset + 1 < mean.size:
        # the response of a mass starts as the square of time, so its root is a straight line that begins at the onset
        first, second = np.sqrt(mean[onset]), np.sqrt(max(mean[onset + 1], mean[onset]))
        start = onset - first / max(second - first, 1e-300)
        expected = mean[onset] * (max(onset - 1 - start, 0.0) / (onset - start)) ** 2
        if start >= onset - 1 or abs(mean[onset - 1] - expected) > SURE * response.deviation[onset - 1]:
            break
        doubtful_notices.append("delay_ambiguous")
        earliest = onset - 2
        if mean[onset - 1] <= LIKELY * response.deviation[onset - 1]:
            break
        onset -= 1
    final = float(np.max(mean))
    if onset <= 1 and mean[onset] > 0.1 * final:
        doubtful_notices.append("delay_unresolved")
    return onset, max(earliest, 0), float(onset), doubtful_notices


def identify_delay(records: Iterable[Record], factors: tuple[int, ...] = (1, 2, 3, 5)) -> Delay:
    """Delay from the onset of the step response, at the finest sample period and at multiples of it.

    The onset is the first sample beyond five standard deviations of the averaged response. A sample beyond two standard
    deviations is the onset if the quadratic start of the response extrapolates to the same sample.

    Parameters
    ----------
    records : iterable of Record
        Records with steps; the finest sample period among them decides, slower ones are compared.
    factors : tuple of int
        Sample times to compare, as multiples of the finest period.

    Returns
    -------
    Delay
        Delay in samples, the onset at each sample time, and notices about its uncertainty.

    Raises
    ------
    IdentificationError
        If there is no step, or no response above the noise.

    Notes
    -----
    Paper, Sec. 3.2. The cost of a fit does not determine the delay: b1 is small, so neighbouring integers fit equally.
    """
    records = tuple(records)
    if not records:
        raise IdentificationError("delay: got no record, expected at least one with steps")
    finest = min(r.sample_period for r in records)
    fine = [r for r in records if r.sample_period < 1.001 * finest]
    response = step_response(fine)
    samples, first, last, doubtful_notices = _onset(response)
    onsets = [Onset(finest, samples, first * finest, last * finest)]
    others = [(fine, factor) for factor in factors if factor > 1]
    others += [([r], 1) for r in records if r.sample_period >= 1.001 * finest]
    for part, factor in others:
        try:
            at = step_response(part, factor)
            n, low, high, _ = _onset(at)
        except IdentificationError:
            continue
        onsets.append(Onset(at.sample_period, n, low * at.sample_period, high * at.sample_period))
    messages = {
        "delay_ambiguous": f"the response begins at sample {samples} or {int(first)}; noise hides the first response",
        "delay_unresolved": (
            f"the response begins within one sample period of {finest:.3g} s, so only an "
            "upper bound of the delay is known"
        ),
    }
    notices = [Notice(kind, message, "step") for kind, message in messages.items() if kind in doubtful_notices]
    if max(o.earliest for o in onsets) >= min(o.latest for o in onsets) + 1e-12:
        answers = ", ".join(
            f"{o.earliest * 1e6:.4g} to {o.latest * 1e6:.4g} µs at {o.sample_period:.3g} s" for o in onsets
        )
        notices.append(
            Notice(
                "delay_inconsistent", f"records of different sample periods give different delays: {answers}", "step"
            )
        )
    return Delay(samples, tuple(onsets), response, tuple(notices))
