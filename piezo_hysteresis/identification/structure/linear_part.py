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

"""The linear part of a model without broadband records: a delay, a lightly damped mode, a pole, more orders."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

import numpy as np

from ...effects import Arx, ExtraResonance
from ...model.model import Model
from ...record import Notice
from ..records.excitation_content import excitation_content
from .piece_fit import DELAY, GAIN, POLE, Array, PieceFit, fit_pieces
from .pieces import Kind, RecordPiece
from .ringing import RESOLVED, SLOWEST, decay_after_steps, ringing_lines, sampled_decay
from .step_weights import lateness_of_steps, misfit_beside_steps, without_steps

LAGS = (0.3, 1.5, 4.0)
"""Start values of the delay [samples]."""
RINGING_STAYS = 0.7
"""A mode is accepted if at most this share of the power in pieces of the kind that rings remains."""
DESCRIBED = 0.1
"""Two more orders of the ARX dynamics are accepted if at most this share of the power after a step remains."""
START_POLES = (0.3, 0.8)
"""Start values of a pole."""
ADDED = 0.5
"""Start value of a second pole, and of the zero that cancels it."""
SETTLED = 4.0
"""Mean square misfit after a step [floors²] up to which nothing else is tried."""
SLOW = 0.8
"""Largest real pole that is added; a slower one, which a zero nearly cancels, would take the place of creep."""
SECOND = 0.5
"""Beside a ringing mode, dynamics of second order are accepted if at most this share of the power after a step remains;
without one, `DESCRIBED` counts."""
POLE_GAINS = 0.98
"""A pole is accepted if at most this share of the cost remains."""
SILENT_GAINS = 0.8
"""A mode that raises the gain at high frequency, without ringing, is accepted if at most this share remains."""
SILENT = (4.0, 10.0)
"""Start values of the frequency of such a mode, as multiples of the highest drive frequency."""
DAMPING = 0.02
"""Start value of the damping ratio of a mode."""
RINGS = 0.3
"""Largest damping ratio of a mode that rings; with it, every cycle has a seventh of the amplitude of the one before.

A fit that ends with more describes a lag, for which there is a delay and a pole.
"""
SILENT_DAMPING = 0.2
"""Damping ratio assumed for a mode that does not ring; its lag is part of the delay."""
WHOLE = 0.3
"""Largest deviation from 1 of the share of a mode of the whole stage; with another share it may be an alias."""
RESOLVES = 0.005
"""Largest share of the power after a step that a mode leaves; an alias leaves 0.007 to 0.4, most modes below 0.003."""
CONTRADICTED = 0.5
"""Largest ratio of the mean square misfits of all other motion without and with the steps if these contradict it."""
SHAPE, SHARE = tuple(f"{ExtraResonance.name}.{n}" for n in ("f0", "zeta")), f"{ExtraResonance.name}.r"
"""Parameters of a mode."""


def free_numbers(model: Model) -> list[str]:
    """Parameters that the fit of a structure adjusts: all except fixed ones and the gauge."""
    held = {GAIN} if not model[Arx.name].values["a"] else set()
    loop = model.hysteresis
    if not loop.has_memory:
        held |= {f"{loop.name}.{n}" for n in loop.fitted_names() if n not in loop.linear_numbers()}
    return [n for n in model.values() if n not in held and not model.row(n).fixed]


def fit_structure(
    model: Model, pieces: Sequence[RecordPiece], floors: Sequence[float], held: Collection[str] = ()
) -> PieceFit:
    """Fit all free parameters of a model except those in `held`."""
    return fit_pieces(model, pieces, floors, [n for n in free_numbers(model) if n not in held])


def fit_linear_part(
    model: Model, pieces: Sequence[RecordPiece], floors: Sequence[float]
) -> tuple[PieceFit, float, float]:
    """Fit a delay; a mode, if the stage rings or its gain rises with frequency; a pole; two more orders, if they help.

    Parameters
    ----------
    model : Model
        Model with a delay as its dynamics.
    pieces : sequence of RecordPiece
        Pieces in order.
    floors : sequence of float
        Floor of every record [m].

    Returns
    -------
    fit : PieceFit
        Fit of all free parameters.
    lead : float
        ln of the factor by which a ringing mode lowers the cost; 0 without such a mode.
    late : float
        How much later the steps come than all other motion says, if they contradict it [samples]; otherwise 0.
    """
    found = [fit_structure(model.with_values({DELAY: lag}), pieces, floors) for lag in LAGS]
    plain = min(found, key=lambda f: f.cost)
    best, lead = _with_poles_and_mode(plain, pieces, floors)
    fast = _with_two_more_orders(plain, best, pieces, floors)
    if fast is not best:
        return fast, 0.0, 0.0
    apart = without_steps(pieces)
    other = fit_structure(best.model, apart, floors, (*held_by(best), *SHAPE, SHARE)) if apart else best
    if misfit_beside_steps(other, pieces) < CONTRADICTED * misfit_beside_steps(best, pieces):
        return other, lead, lateness_of_steps(other, pieces)
    return best, lead, 0.0


def _with_poles_and_mode(
    plain: PieceFit, pieces: Sequence[RecordPiece], floors: Sequence[float]
) -> tuple[PieceFit, float]:
    """The fit with a mode, and dynamics of first or second order, if they help, and the lead of a ringing mode.

    Until a low-pass is part of the model, its lag is most of what is left after a step, and hides the mode. Therefore
    the mode is also searched behind a pole, and behind dynamics of second order, unless a mode of the whole stage
    describes the steps.
    """

    def after_steps(fit: PieceFit) -> float:
        return _misfit_of(Kind.STEP, fit, pieces)

    def is_settled(fit: PieceFit) -> bool:
        return _rings_as_a_whole(fit.model) and not after_steps(fit) > SETTLED

    best, without = _with_pole(_with_mode(plain, pieces, floors), pieces, floors), plain
    if is_settled(best):
        return best, _lead(plain, best)
    lagging = _with_pole(plain, pieces, floors)
    if lagging is not plain and not _rings_as_a_whole(best.model):
        behind = _with_mode(lagging, pieces, floors)
        if set(SHAPE) <= set(behind.names) and behind.cost < best.cost:
            best, without = behind, lagging
    if not is_settled(best) and np.isfinite(after_steps(best)):
        tried = [_with_second_order(f, pieces, floors) for f in (best, lagging) if f.model[Arx.name].array("a").size]
        tried = [f if ExtraResonance.name in f.model else _with_mode(f, pieces, floors) for f in tried]
        slowest = max(SLOW, *(_slowest_pole(f.model) for f in (best, lagging)))
        second = min((f for f in tried if not _slowest_pole(f.model) > slowest), key=lambda f: f.cost, default=best)
        share = SECOND if set(SHAPE) <= set(second.names) else DESCRIBED
        if after_steps(second) < share * after_steps(best):
            best, without = second, lagging
    return best, _lead(without, best)


def _with_pole(start: PieceFit, pieces: Sequence[RecordPiece], floors: Sequence[float]) -> PieceFit:
    """The fit with a pole, if it lowers the cost by enough."""
    held, poles = held_by(start), []
    for pole in START_POLES:
        arx = Arx(a=(-pole,), b=(1.0 - pole,), delay=start.model[Arx.name]["delay"])
        tried = fit_structure(start.model.with_effect(arx), pieces, floors, held)
        if tried.model.values()[POLE] < 0.0:
            poles.append(tried)
    lagging = min(poles, key=lambda f: f.cost, default=start)
    return lagging if lagging.cost < POLE_GAINS * start.cost else start


def _with_second_order(start: PieceFit, pieces: Sequence[RecordPiece], floors: Sequence[float]) -> PieceFit:
    """The fit with ARX dynamics of second order instead of a pole."""
    return fit_structure(_with_factor(start.model, (1.0, -ADDED)), pieces, floors, held_by(start))


def _with_factor(model: Model, factor: Sequence[float] | Array) -> Model:
    """The model with further poles, and zeros that cancel them: the fit begins with the same response."""
    arx = model[Arx.name]
    a, b = (np.convolve(c, factor).tolist() for c in ((1.0, *arx.array("a")), arx.array("b")))
    return model.with_effect(Arx(a=tuple(a[1:]), b=tuple(b), delay=arx["delay"]))


def _slowest_pole(model: Model) -> float:
    """The largest pole of the dynamics that is real and positive; 0 without any."""
    poles = np.roots((1.0, *model[Arx.name].array("a")))
    return max((float(p.real) for p in poles if p.imag == 0.0 and p.real > 0.0), default=0.0)


def _rings_as_a_whole(model: Model) -> bool:
    """Whether there is a mode that rings and is that of the whole stage."""
    if ExtraResonance.name not in model or mode_is_inferred(model):
        return False
    mode = model[ExtraResonance.name]
    return abs(mode["r"] - 1.0) <= WHOLE and mode["zeta"] <= RINGS


def _lead(without: PieceFit, found: PieceFit) -> float:
    """ln of the factor by which a ringing mode lowers the cost; 0 without such a mode."""
    return float(np.log(without.cost / found.cost)) if set(SHAPE) & set(found.names) else 0.0


def _with_two_more_orders(
    plain: PieceFit, best: PieceFit, pieces: Sequence[RecordPiece], floors: Sequence[float]
) -> PieceFit:
    """The fit with ARX of two more orders if it describes the response to the steps, else `best`.

    A mode above half the sampling rate rings at another frequency in the samples and has zeros that a mode has not.
    Therefore such a mode leaves a part of the residual after the steps. A mode that leaves hardly anything stays. The
    fit begins with the poles of the mode that was found, or with poles that explain the residual after the steps, and
    with a pair of equal zeros, which is the response of the fit before.
    """

    def after_steps(fit: PieceFit) -> float:
        return _misfit_of(Kind.STEP, fit, pieces)

    rings = ExtraResonance.name in best.model and not mode_is_inferred(best.model)
    if rings and not after_steps(best) > RESOLVES * after_steps(plain):  # also without any step
        return best
    before = plain if ExtraResonance.name in best.model else best
    decay = sampled_decay(best.model) if rings else decay_after_steps(before.model, pieces)
    if decay is None:
        return best
    found = fit_structure(_with_factor(before.model, decay), pieces, floors)
    describes = after_steps(found) < DESCRIBED * after_steps(best)
    return found if describes and found.cost < best.cost else best


def held_by(fit: PieceFit) -> tuple[str, ...]:
    """Parameters of a mode that a fit does not adjust."""
    return tuple(n for n in (*SHAPE, SHARE) if n in fit.model.values() and n not in fit.names)


def mode_is_inferred(model: Model) -> bool:
    """Whether a mode stands for a gain that changes with frequency, with assumed damping, because it does not ring."""
    return ExtraResonance.name in model and model[ExtraResonance.name]["zeta"] == SILENT_DAMPING


def assumed_numbers(model: Model) -> tuple[str, ...]:
    """Numbers without an interval: those of an inferred mode, and the delay, which depends on its assumed damping."""
    return (*SHAPE, SHARE, DELAY) if mode_is_inferred(model) else ()


def lag_of_mode(model: Model) -> dict[str, float]:
    """By how much later a mode makes slow signals [samples], as ``lag``, and its derivatives by ``r`` and ``f0``."""
    mode = model[ExtraResonance.name]
    by_share = mode["zeta"] / (np.pi * mode["f0"] * model.sample_period)
    return {"lag": mode["r"] * by_share, "r": by_share, "f0": -mode["r"] * by_share / mode["f0"]}


def mode_notices(fit: PieceFit) -> list[Notice]:
    """``ringing`` with the numbers of the mode, if there is one; one that does not ring has the assumed damping."""
    if ExtraResonance.name not in fit.model:
        poles = np.roots((1.0, *fit.model[Arx.name].array("a")))
        if not any(_damping(p) <= RINGS for p in poles):
            return []
        said = f"the stage rings after steps; ARX of order {poles.size} describes its samples better than a mode does"
        return [Notice("ringing", said)]
    mode = fit.model[ExtraResonance.name]
    shown = f"a mode at {mode['f0']:.4g} Hz with"
    if not mode_is_inferred(fit.model):
        said = f"the stage rings after steps or sharp turns: {shown} a damping ratio of {mode['zeta']:.2g}"
    else:
        said = (
            f"the gain changes with the frequency of the drive; {shown} a share of {mode['r']:.3g} stands for this, "
            "but its frequency, damping and share and the delay are not determined separately and have no intervals"
        )
    return [Notice("ringing", said)]


def _damping(pole: complex) -> float:
    """Damping ratio of a pole of the samples; 1 for one that is real and positive, or 0."""
    if pole == 0.0:
        return 1.0
    decay = np.log(complex(pole))
    return float(-decay.real / abs(decay))


def _with_mode(plain: PieceFit, pieces: Sequence[RecordPiece], floors: Sequence[float]) -> PieceFit:
    found = plain
    for frequency, kind in ringing_lines(plain.model, pieces):
        mode = ExtraResonance(r=1.0, f0=frequency, zeta=DAMPING)
        rings = fit_structure(plain.model.with_effect(mode), pieces, floors)
        described = _misfit_of(kind, rings, pieces) < RINGING_STAYS * _misfit_of(kind, plain, pieces)
        if described and rings.cost < found.cost and rings.model[ExtraResonance.name]["zeta"] <= RINGS:
            found = rings
    if found is plain or abs(found.model.values()[SHARE] - 1.0) > WHOLE:
        silent = min(_silent(plain, pieces, floors), key=lambda f: f.cost, default=plain)
        if silent.cost < SILENT_GAINS * found.cost:
            found = silent
    return found


def _silent(plain: PieceFit, pieces: Sequence[RecordPiece], floors: Sequence[float]) -> Iterator[PieceFit]:
    """Fits with a mode that no step shows; each adjusts either its frequency, or its share at the highest frequency."""
    if len({p.rate for p in pieces if p.kind is Kind.LOOP}) < 2:
        return  # at one rate, the gain cannot rise with frequency
    loops = [p.record for p in pieces if p.kind is Kind.LOOP]
    fastest = max((excitation_content(r).bandwidth for r in loops), default=0.0)
    top = RESOLVED / min(p.record.sample_period for p in pieces)
    for times in SILENT:
        if SLOWEST < times * fastest < top:
            mode = ExtraResonance(r=1.0, f0=times * fastest, zeta=SILENT_DAMPING)
            yield fit_structure(plain.model.with_effect(mode), pieces, floors, (SHARE, SHAPE[1]))
    if top <= SLOWEST:
        return
    mode = ExtraResonance(r=0.5, f0=top, zeta=SILENT_DAMPING)
    yield fit_structure(plain.model.with_effect(mode), pieces, floors, SHAPE)


def _misfit_of(kind: Kind, fit: PieceFit, pieces: Sequence[RecordPiece]) -> float:
    """Mean square misfit of the pieces of one kind, in floors; infinite without any."""
    counted = [p for p in pieces if p.kind is not Kind.CONDITIONING]
    found = [s for s, p in zip(fit.squares.tolist(), counted, strict=True) if p.kind is kind]
    return float(np.mean(found)) if found else np.inf
