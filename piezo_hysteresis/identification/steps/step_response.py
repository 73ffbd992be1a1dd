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

"""`StepResponse`: the response to a jump of the drive, averaged over all jumps, with its uncertainty."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from ...errors import IdentificationError
from ...record import Record, Samples
from ..records.edges import Edge, find_edges

BEFORE = (64, 32, 16)
"""Largest number of samples before an edge for the base line; fewer if the stage still rings."""
LONGEST = 4096
"""Largest number of samples after an edge in which the onset is searched."""
QUIET = 2.0
"""Largest scatter before an edge that is averaged, as a multiple of that before the quietest edge."""
NEGLIGIBLE = 1e-4
"""Scatter that is always accepted, relative to the range of the displacement."""
RARE = 1e-4
"""Probability that noise alone has so much more scatter before one edge than before another."""
SCATTER = 3.0
"""Largest deviation of the end of a base line from the extrapolation of its beginning, in standard deviations."""


@dataclass(frozen=True, eq=False, slots=True)
class StepResponse:
    """Displacement after a step, per volt, averaged over all edges.

    Parameters
    ----------
    sample_period : float
        Sample period [s].
    mean : (n,) array
        Response per volt of step [m/V]; sample 0 is the first at the new voltage.
    deviation : (n,) array
        Standard deviation of `mean` from the noise before the edges [m/V].
    edges : int
        Number of edges averaged.
    freedom : int
        Degrees of freedom of the noise estimate.
    """

    sample_period: float
    mean: Samples
    deviation: Samples
    edges: int
    freedom: int


def step_response(records: Iterable[Record], every: int = 1) -> StepResponse:
    """Average the response to all edges before which the stage is quiet, weighted by their heights.

    Parameters
    ----------
    records : iterable of Record
        Records with steps, all at one sample period.
    every : int
        Use only every n-th sample after each edge, as for a longer sample period.

    Returns
    -------
    StepResponse
        Mean response per volt and its standard deviation.

    Raises
    ------
    IdentificationError
        If there is no edge with a quiet interval before it.
    """
    edges = [(record, edge) for record in records for edge in find_edges(record.voltage, 8 * every, 4 * every)]
    if not edges:
        raise IdentificationError(
            f"no step found: expected an edge of over a fifth of the drive range within 8 samples, with {8 * every} "
            f"quiet samples before it and {4 * every} after it; record a step phase"
        )
    resolution = _resolution({id(r): r for r, _ in edges}.values())
    bases = [_BaseLine.before(record, edge, every, BEFORE[0]) for record, edge in edges]
    # about the mean: slow ringing of a soft stage looks straight over a base line but does not continue so
    scatters = np.array([base.samples.std(ddof=1) for base in bases])
    swing = max(float(np.ptp(record.displacement)) for record, _ in edges)
    quietest = max(float(scatters.min()), resolution / np.sqrt(12.0), NEGLIGIBLE * swing)
    freedom = min(base.size for base in bases) - 1
    by_chance = float(np.sqrt(scipy.stats.f.isf(RARE, freedom, freedom)))
    edges = [e for e, scatter in zip(edges, scatters, strict=True) if scatter <= max(QUIET, by_chance) * quietest]
    # ringing is not straight over a long base line; a short base line is noisy
    for most in BEFORE:
        response, ringing = _averaged(edges, every, most, resolution)
        if ringing == 1.0:
            break
    return response


def _resolution(records: Iterable[Record]) -> float:
    """Smallest change of the displacement [m]; quantised or simulated data can be perfectly quiet."""
    changes = (np.abs(np.diff(r.displacement)) for r in records)
    finest = min(float(np.min(c, where=c > 0.0, initial=np.inf)) for c in changes)
    return finest if finest < np.inf else 0.0


@dataclass(frozen=True, slots=True)
class _BaseLine:
    """The straight line through the displacement before an edge."""

    samples: Samples

    @classmethod
    def before(cls, record: Record, edge: Edge, every: int, most: int) -> _BaseLine:
        size = min(most, edge.quiet_before // every)
        return cls(record.displacement[edge.start - every * np.arange(size, 0, -1)])

    @property
    def size(self) -> int:
        return self.samples.size

    @property
    def places(self) -> Samples:
        """Positions of the samples, relative to their middle."""
        return np.arange(float(self.size)) - 0.5 * (self.size - 1)

    @property
    def slope(self) -> float:
        return float(self.places @ self.samples / (self.places @ self.places))

    @property
    def squares(self) -> float:
        """Sum of squares about the line [m²]; its degrees of freedom are `size - 2`."""
        off = self.samples - self.samples.mean() - self.slope * self.places
        return float(off @ off)

    def at(self, ahead: Samples) -> tuple[Samples, Samples]:
        """The line `ahead` samples after its end [m], and its variance for white noise of variance 1."""
        away = ahead + 0.5 * (self.size + 1)
        return self.samples.mean() + self.slope * away, 1.0 / self.size + away**2 / (self.places @ self.places)


def _averaged(
    edges: Sequence[tuple[Record, Edge]], every: int, most: int, resolution: float
) -> tuple[StepResponse, float]:
    """Mean response from base lines of limited length, and the factor by which ringing increases its error."""
    after = min(LONGEST, min(edge.quiet_after for _, edge in edges) // every)
    ahead = np.arange(after)
    weighted, weight, variance = np.zeros(after), 0.0, np.zeros(after)
    squares, freedom = 0.0, 0
    missed, expected = 0.0, 0.0
    for record, edge in edges:
        base = _BaseLine.before(record, edge, every, most)
        squares += base.squares
        freedom += base.size - 2
        line, uncertain = base.at(ahead.astype(np.float64))
        weighted += edge.height * (record.displacement[edge.start + every * ahead] - line)
        weight += edge.height**2
        off, spread = _extrapolation_error(base.samples)
        missed, expected = missed + edge.height * off, expected + edge.height**2 * spread
        variance += edge.height**2 * (1.0 + uncertain)
    noise = max(squares / freedom, resolution**2 / 12.0)
    # ringing before an edge continues after it, with the same phase at all edges, so averaging does not remove it
    ringing = max(1.0, abs(missed) / max(SCATTER * float(np.sqrt(noise * expected)), 1e-300))
    deviation = ringing * np.sqrt(noise * variance) / weight
    period = every * edges[0][0].sample_period
    return StepResponse(period, weighted / weight, deviation, len(edges), freedom), ringing


def _extrapolation_error(base: Samples) -> tuple[float, float]:
    """Difference between the mean of the last quarter of a base line and a line through the first three quarters.

    Returns
    -------
    float
        Measured minus predicted [m].
    float
        Its variance for white noise of variance 1.
    """
    split = 3 * base.size // 4
    late = base[split:]
    line, uncertain = _BaseLine(base[:split]).at(np.array([0.5 * (late.size - 1)]))
    return float(late.mean() - line[0]), float(1.0 / late.size + uncertain[0])
