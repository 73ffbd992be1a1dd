"""Step 3: modified Bouc-Wen by nonlinear least squares, from a start that needs no guess (paper, Sec. 3.4).

For given β and γ the state is proportional to A, and a negative A is the same loop with −γ: with g the state for A = 1,

    w = p1 v³ + p2 v + A·g(v; β, γ·sgn A) + offset

is linear in p1, p2, A and the offsets. So only (β, γ/β) are searched, on a grid and then downhill.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter
from scipy.optimize import least_squares

from ...effects import Arx, BoucWen, Discretisation, PublishedBoucWen
from ...errors import IdentificationError
from ...model.model import Model
from ...record import Record, Samples
from ..fit.fit import Fit, fit
from ..fit.normal_equations import Nuisance
from ..records.conditioning import select

LOSSES = np.geomspace(0.3, 100.0, 14)
"""Grid of β for v on its range."""
RATIOS = np.linspace(-0.9, 0.9, 7)
"""Grid of γ·sgn(A)/β; |γ| ≤ β keeps the loop bounded."""
VALLEYS = 3
"""Places of the grid from which the search goes downhill, at most."""
DEEP = 10.0
"""Cost, relative to that of the best place, up to which another one is tried."""
LOOP = ("A", "beta", "gamma", "p1", "p2")
"""Numbers of the modified Bouc-Wen operator."""
POINTS = 6000
"""About how many points of the data the search uses."""


@dataclass(frozen=True, eq=False, slots=True)
class Loop:
    """Input and output of the hysteresis in one record.

    Parameters
    ----------
    v : (n,) array
        Normalised input.
    w : (n,) array
        Hysteresis output.
    continues : bool
        True where the state of the loop before is carried on.
    start : float
        v at which the stage had settled before, where it does not continue.
    weight : float
        Weight in the search; 0 where the record only carries the state.
    """

    v: Samples
    w: Samples
    continues: bool = False
    start: float = 0.0
    weight: float = 1.0


def loop_of(record: Record, model: Model, weight: float = 1.0) -> Loop:
    """What the hysteresis did in a slow record: v = u/voltage_scale, w(t) = y(t + lag)/gain.

    Parameters
    ----------
    record : Record
        So slow that the dynamics are a gain and a lag, e.g. the 1 Hz triangle.
    model : Model
        Its scales and its `Arx`, whose dc gain and group delay count; the paper takes K and d alone.
    weight : float
        Weight in the search.
    """
    arx = model["arx"]
    assert isinstance(arx, Arx)
    time = record.sample_period * np.arange(record.size)
    y = np.interp(time + arx.group_delay * model.sample_period, time, record.displacement)
    scale = model.voltage_scale
    return Loop(
        record.voltage / scale,
        y / (model.displacement_scale * arx.dc_gain),
        record.continues,
        record.settled_voltage / scale,
        weight,
    )


def _thinned(loop: Loop, points: int) -> Loop:
    """Fewer points, the extremes of v in every stretch among them, so that no turning point is lost."""
    stretch = -(-3 * loop.v.size // points)
    if stretch < 4:
        return loop
    whole = loop.v.size // stretch
    rows = loop.v[: whole * stretch].reshape(whole, stretch)
    first = stretch * np.arange(whole)
    keep = np.unique(
        np.concatenate((first, first + rows.argmin(axis=1), first + rows.argmax(axis=1), [loop.v.size - 1]))
    )
    return Loop(loop.v[keep], loop.w[keep], loop.continues, loop.start, loop.weight)


def _state(loops: Sequence[Loop], beta: float, gamma: float) -> list[Samples]:
    """State g of every loop for A = 1."""
    block = BoucWen(A=1.0, beta=beta, gamma=gamma, p1=0.0, p2=0.0).block(Discretisation(1.0, 1.0))
    state, result = None, []
    for loop in loops:
        if state is None or not loop.continues:
            state = block.rest(loop.start, 0.0)
        g, state = block.run(loop.v, state)
        result.append(g)
    return result


class _Search:
    """Linear least squares inside the nonlinear one, on thinned loops."""

    def __init__(self, loops: Sequence[Loop]) -> None:
        share = POINTS // max(1, sum(loop.weight > 0 for loop in loops))
        self.loops = [_thinned(loop, max(share, 500)) for loop in loops]
        self.used = [i for i, loop in enumerate(self.loops) if loop.weight > 0]
        self.roots = [np.sqrt(loop.weight / loop.v.size) for loop in self.loops]
        self.fixed = self._stack([np.column_stack((loop.v**3, loop.v)) for loop in self.loops])
        self.target = self._stack([loop.w for loop in self.loops])

    def _stack(self, columns: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
        """Records one below the other, each freed of its own offset and weighted."""
        return np.concatenate([self.roots[i] * (columns[i] - columns[i].mean(axis=0)) for i in self.used])

    def solve(self, beta: float, ratio: float) -> tuple[Samples, Samples]:
        """(p1, p2, A) and the weighted residuals."""
        g = self._stack(_state(self.loops, beta, ratio * beta))
        matrix = np.column_stack((self.fixed, g))
        scale = np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
        theta = np.linalg.lstsq(matrix / scale, self.target, rcond=1e-10)[0] / scale
        return theta, self.target - matrix @ theta


def start_hysteresis(loops: Sequence[Loop]) -> BoucWen:
    """Modified Bouc-Wen operator closest to the loops, without any start value.

    Parameters
    ----------
    loops : sequence of Loop
        In experiment order; those of weight 0 only carry the state.

    Returns
    -------
    BoucWen
        With β ≥ |γ|; good enough to start the fit on all samples.

    Raises
    ------
    IdentificationError
        If no loop has weight, or the input does not move.
    """
    weighted = [loop for loop in loops if loop.weight > 0]
    span = max((float(np.ptp(np.append(loop.v, loop.start))) for loop in weighted), default=0.0)
    if span == 0.0:
        raise IdentificationError(
            f"hysteresis: got {len(weighted)} records whose drive moves by {span:g}, "
            "expected at least one with loops, e.g. a triangle of several amplitudes"
        )
    search = _Search([replace(loop, v=loop.v / span, start=loop.start / span) for loop in loops])
    costs = np.array([[float(np.sum(search.solve(beta, ratio)[1] ** 2)) for ratio in RATIOS] for beta in LOSSES])
    polished = [
        least_squares(
            lambda x: search.solve(np.exp(x[0]), x[1])[1],
            [np.log(LOSSES[i]), RATIOS[j]],
            bounds=([np.log(LOSSES[0] / 10.0), -1.0], [np.log(LOSSES[-1] * 10.0), 1.0]),
            x_scale=[1.0, 0.3],
        )
        for i, j in _valleys(costs)
    ]
    found = min(polished, key=lambda outcome: float(outcome.cost))
    beta, ratio = float(np.exp(found.x[0])), float(found.x[1])
    p1, p2, a = (float(c) for c in search.solve(beta, ratio)[0])
    return BoucWen(
        A=a / span, beta=beta / span, gamma=beta * ratio * np.copysign(1.0, a) / span, p1=p1 / span**3, p2=p2 / span
    )


def _valleys(costs: NDArray[np.float64]) -> list[tuple[int, int]]:
    """Places on the grid lower than their neighbours, the lowest first: loops of one amplitude have several."""
    lowest = minimum_filter(costs, size=3, mode="nearest")
    places = np.argwhere((costs == lowest) & (costs <= DEEP * costs.min()))
    order = np.argsort([costs[i, j] for i, j in places])
    return [(int(i), int(j)) for i, j in places[order][:VALLEYS]]


def fit_hysteresis(model: Model, records: Sequence[Record], loops: Collection[int]) -> Fit:
    """Step 3: the numbers of the hysteresis, with the dynamics as they are and a free offset per record.

    Parameters
    ----------
    model : Model
        Scales, dynamics, and the form of the hysteresis; its values do not matter.
    records : sequence of Record
        The experiment, in order.
    loops : collection of int
        Indices of the slow records to fit; those they continue carry the state.

    Returns
    -------
    Fit
        Of A, β, γ, p1, p2, from all samples.
    """
    kept, floors = select(records, [1.0] * len(records), loops)
    start = start_hysteresis([loop_of(r, model, float(np.isfinite(f))) for r, f in zip(kept, floors, strict=True)])
    name = hysteresis_name(model)
    model = model.with_values({f"{name}.{n}": float(v) for n, v in start.values.items()})  # type: ignore[arg-type]
    return fit(model, kept, [f"{name}.{n}" for n in LOOP], floors=floors, nuisance=Nuisance(offset=True))


def hysteresis_name(model: Model) -> str:
    """Name of the Bouc-Wen operator in the chain: `bouc_wen`, or `published_bouc_wen` for the form of Eq. (7)."""
    return PublishedBoucWen.name if PublishedBoucWen.name in model else BoucWen.name
