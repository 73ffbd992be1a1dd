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

"""The linear part of a model without broadband records: a delay, a mode, a low-pass, a largest slope, more orders."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...effects import AmplifierSlewLimitHeld, Arx, ExtraResonance
from ...model.model import Model
from .mode import DAMPING, SHAPE, SHARE, held_by, mode_is_inferred, rings_as_a_whole, rings_at, with_mode
from .piece_fit import DELAY, Array, PieceFit
from .pieces import Kind, RecordPiece
from .pole_place import POLE_GAINS, LinearPart, in_every_place, real_poles, with_pole
from .ringing import decay_after_steps, ringing_lines, sampled_decay
from .step_edge import with_slew_limit
from .step_weights import lateness_of_steps, misfit_beside_steps, without_steps
from .structure_fit import SETTLED, fit_structure, is_settled, misfit_of
from .uncertainty import BETWEEN_SAMPLES

LAGS = (0.3, 1.5, 4.0)
"""Start values of the delay [samples]."""
LATE = 20
"""Delay of the response to a step that is a further start value [samples]."""
DESCRIBED = 0.1
"""Two more orders of the ARX dynamics are accepted if at most this share of the power after a step, or of the whole
cost, remains."""
START_POLES = (0.3, 0.8)
"""Start values of a pole."""
ADDED = 0.5
"""Start value of a second pole, and of the zero that cancels it."""
SLOW = 0.8
"""Largest real pole that is added; a slower one, which a zero nearly cancels, would take the place of creep."""
SECOND = 0.5
"""Beside a ringing mode, dynamics of second order or a second mode are accepted if at most this share of the power
after a step remains; without one, `DESCRIBED` counts. So is a largest slope of the drive, and it must leave at most
this share of the cost, too: a slope that the first samples just show takes the place of a lag."""
SHOWN = 0.98
"""Largest share of the power after a step that a slope of the drive leaves without any mode, if the steps show it."""
RESOLVES = 0.005
"""Largest share of the power after a step that a mode leaves; an alias leaves 0.007 to 0.4, most modes below 0.003."""
CONTRADICTED = 0.5
"""Largest ratio of the mean square misfits of all other motion without and with the steps if these contradict it."""


def fit_linear_part(model: Model, pieces: Sequence[RecordPiece], floors: Sequence[float]) -> LinearPart:
    """Fit a delay, and if they help: a mode, a pole or dynamics of second order, a largest slope, more orders.

    Parameters
    ----------
    model : Model
        Model with a delay as its dynamics.
    pieces : sequence of RecordPiece
        Pieces in order.
    floors : sequence of float
        Floor of every record [m].
    """
    lags = (*LAGS, *_late_responses(pieces))
    found = [fit_structure(model.with_values({DELAY: lag}), pieces, floors) for lag in lags]
    plain = min(found, key=lambda f: f.cost)
    best, lead = _with_poles_and_mode(plain, pieces, floors)
    start, late, refused = best, with_slew_limit(best, pieces, floors), list[PieceFit]()
    if late is not best and not is_settled(best, pieces):  # some record begins with a step
        limited, its_lead = _behind_slew_limit(plain, late, lead, pieces, floors)
        if max(_shares_left(limited, best, pieces)) < SECOND:
            best, lead = limited, its_lead
        else:
            refused.append(limited)
    best = _with_second_mode(best, pieces, floors)
    best, *others = in_every_place(best, pieces, floors)
    if AmplifierSlewLimitHeld.name in best.model:  # poles and modes that were found behind a slope may do without it
        bare = fit_structure(best.model.without(AmplifierSlewLimitHeld.name), pieces, floors, held_by(best))
        if not max(_shares_left(best, bare, pieces)) < SECOND:
            best, others = bare, [*others, best]
    else:
        # it may be as likely as a pole or a delay
        others += [*refused, late if best is start else with_slew_limit(best, pieces, floors)]
    fast = _with_two_more_orders(plain, best, pieces, floors)
    if fast is not best:
        return LinearPart(fast, 0.0)
    apart = without_steps(pieces)
    other = fit_structure(best.model, apart, floors, (*held_by(best), *SHAPE, SHARE)) if apart else best
    if misfit_beside_steps(other, pieces) < CONTRADICTED * misfit_beside_steps(best, pieces):
        return LinearPart(other, lead, late=lateness_of_steps(other, pieces))
    return LinearPart(best, lead, others)


def _late_responses(pieces: Sequence[RecordPiece]) -> list[float]:
    """The delay of half the height of the first step, as a further start if it is long [samples].

    From a short delay, a fit does not find one of more than half a cycle of the fastest drive.
    """
    step = next((k for k, p in enumerate(pieces) if p.kind is Kind.STEP), None)
    if step is None:
        return []
    response = np.concatenate([p.record.displacement for p in pieces[step : step + 2]])  # with the hold
    rise = np.abs(response - response[0])
    late = int(np.argmax(rise > 0.5 * rise.max()))
    return [float(late)] if late > LATE else []


def _with_poles_and_mode(
    plain: PieceFit, pieces: Sequence[RecordPiece], floors: Sequence[float]
) -> tuple[PieceFit, float]:
    """The fit with a mode, and dynamics of first or second order, if they help, and the lead of a ringing mode.

    Until a low-pass is part of the model, its lag is most of what is left after a step, and hides the mode. Therefore
    the mode is also searched behind a pole, and behind dynamics of second order, unless a mode of the whole stage
    describes the steps.
    """

    def is_described(fit: PieceFit) -> bool:
        return rings_as_a_whole(fit.model) and _after_steps(fit, pieces) <= SETTLED

    ringing = with_mode(plain, pieces, floors)
    best, without = _with_pole(ringing, pieces, floors), plain
    if is_described(best):
        return best, _lead(plain, best)
    lagging = best if ringing is plain else _with_pole(plain, pieces, floors)
    if lagging is not plain and not rings_as_a_whole(best.model):
        behind = with_mode(lagging, pieces, floors)
        if set(SHAPE) <= set(behind.names) and behind.cost < best.cost:
            best, without = behind, lagging
    if not is_described(best) and np.isfinite(_after_steps(best, pieces)):
        begun = [f for f in dict.fromkeys((best, lagging)) if f.model[Arx.name].array("a").size]
        tried = [_with_second_order(f, pieces, floors) for f in begun]
        tried = [f if ExtraResonance.name in f.model else with_mode(f, pieces, floors) for f in tried]
        slowest = max([SLOW, *real_poles(best.model), *real_poles(lagging.model)])
        quick = [f for f in tried if all(pole <= slowest for pole in real_poles(f.model))]
        second = min(quick, key=lambda f: f.cost, default=best)
        share = SECOND if set(SHAPE) <= set(second.names) else DESCRIBED
        if _after_steps(second, pieces) < share * _after_steps(best, pieces):
            best, without = second, lagging
    return best, _lead(without, best)


def _behind_slew_limit(
    plain: PieceFit, late: PieceFit, lead: float, pieces: Sequence[RecordPiece], floors: Sequence[float]
) -> tuple[PieceFit, float]:
    """The fit with a largest slope of the drive, and the lead of a ringing mode; `late` has poles and mode already.

    Poles and mode that describe a slow edge hide the slope, so it is fitted before them, too, if the steps show it
    then. From one slow rate, some slopes are found only after them.
    """
    early, its_lead = with_slew_limit(plain, pieces, floors), 0.0
    if _after_steps(early, pieces) < SHOWN * _after_steps(plain, pieces):
        early, its_lead = _with_poles_and_mode(early, pieces, floors)
    ringing = late if ExtraResonance.name in late.model else with_mode(late, pieces, floors)
    whole = ringing if real_poles(ringing.model) else _with_pole(ringing, pieces, floors)
    after = whole, lead if ringing is late else _lead(late, ringing)
    return min((early, its_lead), after, key=lambda found: found[0].cost)


def _with_pole(start: PieceFit, pieces: Sequence[RecordPiece], floors: Sequence[float]) -> PieceFit:
    """The fit with a pole, if it lowers the cost by enough."""
    held = held_by(start)
    found = [fit_structure(with_pole(start.model, pole), pieces, floors, held) for pole in START_POLES]
    lagging = min((f for f in found if real_poles(f.model)), key=lambda f: f.cost, default=start)
    return lagging if lagging.cost < POLE_GAINS * start.cost else start


def _with_second_order(start: PieceFit, pieces: Sequence[RecordPiece], floors: Sequence[float]) -> PieceFit:
    """The fit with ARX dynamics of second order instead of a pole."""
    return fit_structure(_with_factor(start.model, (1.0, -ADDED)), pieces, floors, held_by(start))


def _with_factor(model: Model, factor: Sequence[float] | Array) -> Model:
    """The model with further poles, and zeros that cancel them: the fit begins with the same response."""
    arx = model[Arx.name]
    a, b = (np.convolve(c, factor).tolist() for c in ((1.0, *arx.array("a")), arx.array("b")))
    return model.with_effect(Arx(a=tuple(a[1:]), b=tuple(b), delay=arx["delay"]))


def _lead(without: PieceFit, found: PieceFit) -> float:
    """ln of the factor by which a ringing mode lowers the cost; 0 without such a mode."""
    return float(np.log(without.cost / found.cost)) if set(SHAPE) <= set(found.names) else 0.0


def _with_two_more_orders(
    plain: PieceFit, best: PieceFit, pieces: Sequence[RecordPiece], floors: Sequence[float]
) -> PieceFit:
    """The fit with ARX of two more orders if it describes the response to the steps, else `best`.

    A mode above half the sampling rate rings at another frequency in the samples and has zeros that a mode has not.
    Therefore such a mode leaves a part of the residual after the steps, or moves against the drive, or needs poles and
    no delay, although a held drive is late by half a sample. Any other mode that leaves hardly anything stays. The fit
    begins with the poles of the mode that was found, or with poles that explain the residual after the steps, and with
    a pair of equal zeros, which is the response of the fit before.
    """
    rings = ExtraResonance.name in best.model and not mode_is_inferred(best.model)
    early_poles = best.model[Arx.name].array("a").size if best.model[Arx.name]["delay"] < BETWEEN_SAMPLES else 0
    against = rings and best.model.values()[SHARE] < 0.0
    leaves = _after_steps(best, pieces) > RESOLVES * _after_steps(plain, pieces)  # not without any step
    if rings and not early_poles and not leaves and not against:
        return best
    before = plain if ExtraResonance.name in best.model else best
    decay = (
        sampled_decay(best.model.effect(ExtraResonance), best.model.sample_period)
        if rings
        else decay_after_steps(before.model, pieces)
    )
    if decay is None:
        return best
    found = fit_structure(_with_factor(before.model, decay), pieces, floors)
    if against or (rings and early_poles > 1):  # the mode is none, or has more numbers than the fit
        return best if best.cost < POLE_GAINS * found.cost else found
    shares = _shares_left(found, best, pieces)
    return found if max(shares) < 1.0 and min(shares) < DESCRIBED else best


def _with_second_mode(best: PieceFit, pieces: Sequence[RecordPiece], floors: Sequence[float]) -> PieceFit:
    """The fit with ARX of two more orders for a second mode beside the first, if the residual rings; else `best`."""
    rings = ExtraResonance.name in best.model and not mode_is_inferred(best.model)
    if not rings or is_settled(best, pieces):
        return best
    lines = [ExtraResonance(r=1.0, f0=f, zeta=DAMPING) for f, _ in ringing_lines(best.model, pieces)]
    models = [_with_factor(best.model, sampled_decay(line, best.model.sample_period)) for line in lines]
    tried = [fit_structure(m, pieces, floors, held_by(best)) for m in models]
    found, line = min(zip(tried, lines, strict=True), key=lambda f: f[0].cost, default=(best, None))
    if line is None or not _after_steps(found, pieces) < SECOND * _after_steps(best, pieces):
        return best
    alone = fit_structure(found.model.without(ExtraResonance.name), pieces, floors)
    if not found.cost < POLE_GAINS * alone.cost:  # the first mode was none
        moved = fit_structure(best.model.with_effect(line), pieces, floors)
        is_told = rings_at(line["f0"], moved.model) and not max(_shares_left(alone, moved, pieces)) < SECOND
        found = moved if is_told else alone
    return found if real_poles(found.model) else _with_pole(found, pieces, floors)


def _shares_left(found: PieceFit, before: PieceFit, pieces: Sequence[RecordPiece]) -> tuple[float, float]:
    """Shares of the power after the steps, and of the cost, that a fit leaves."""
    return _after_steps(found, pieces) / _after_steps(before, pieces), found.cost / before.cost


def _after_steps(fit: PieceFit, pieces: Sequence[RecordPiece]) -> float:
    """Mean square misfit after the steps, in floors; infinite without any."""
    return misfit_of(Kind.STEP, fit, pieces)
