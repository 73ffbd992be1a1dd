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

"""A lightly damped mode: its search, what the data do not determine of it, and what is said of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...effects import Arx, ExtraResonance
from ...model.model import Model
from ...record import Notice
from ..records.excitation_content import excitation_content
from ..steps.linear_start import dynamics_of
from .piece_fit import DELAY, PieceFit
from .pieces import Kind, RecordPiece
from .ringing import RESOLVED, SAME_LINE, SLOWEST, ringing_lines
from .structure_fit import FEW, fit_structure, misfit_of

RINGING_STAYS = 0.7
"""A mode is accepted if at most this share of the power in pieces of the kind that rings remains."""
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
VISIBLE = 0.001
"""Smallest share of a step that a pole of the dynamics contributes, if it is told that it rings."""
FARTHEST_ALIAS = 4.0
"""Largest ratio of the frequency of a mode that rings alike in the samples to that of the mode, if it is told."""
WHOLE = 0.3
"""Largest deviation from 1 of the share of a mode of the whole stage; with another share it may be an alias."""
SHAPE, SHARE = tuple(f"{ExtraResonance.name}.{n}" for n in ("f0", "zeta")), f"{ExtraResonance.name}.r"
"""Parameters of a mode."""


def with_mode(plain: PieceFit, pieces: Sequence[RecordPiece], floors: Sequence[float]) -> PieceFit:
    """The fit with a mode, if the stage rings or its gain rises with frequency; else `plain`."""
    found = plain
    for frequency, kind in ringing_lines(plain.model, pieces):
        mode = ExtraResonance(r=1.0, f0=frequency, zeta=DAMPING)
        rings = fit_structure(plain.model.with_effect(mode), pieces, floors)
        described = misfit_of(kind, rings, pieces) < RINGING_STAYS * misfit_of(kind, plain, pieces)
        if described and rings_at(frequency, rings.model) and rings.cost < found.cost:
            found = rings
    if found is plain or abs(found.model.values()[SHARE] - 1.0) > WHOLE:
        silent = _silent(plain, pieces, floors)
        if silent.cost < SILENT_GAINS * found.cost:
            found = silent
    return found


def rings_at(line: float, model: Model) -> bool:
    """Whether the mode of a model explains a line [Hz]."""
    mode = model[ExtraResonance.name]
    return max(mode["f0"] / line, line / mode["f0"]) < SAME_LINE and mode["zeta"] <= RINGS


def _silent(plain: PieceFit, pieces: Sequence[RecordPiece], floors: Sequence[float]) -> PieceFit:
    """The fit with a mode that no step shows: either its frequency, or its share at the highest one, is adjusted."""
    if len({p.rate for p in pieces if p.kind is Kind.LOOP}) < 2:
        return plain  # at one rate, the gain cannot rise with frequency
    loops = [p.record for p in pieces if p.kind is Kind.LOOP]
    fastest = max((excitation_content(r).bandwidth for r in loops), default=0.0)
    top = RESOLVED / min(p.record.sample_period for p in pieces)
    if top <= SLOWEST:
        return plain
    slower = [f for f in (times * fastest for times in SILENT) if SLOWEST < f < top]
    begun = []
    for share, frequency, held in (*((1.0, f, (SHARE, SHAPE[1])) for f in slower), (0.5, top, SHAPE)):
        mode = ExtraResonance(r=share, f0=frequency, zeta=SILENT_DAMPING)
        begun.append(fit_structure(plain.model.with_effect(mode), pieces, floors, held, FEW))
    best = min(begun, key=lambda f: f.cost)
    return fit_structure(best.model, pieces, floors, held_by(best))


def held_by(fit: PieceFit) -> tuple[str, ...]:
    """Parameters of a mode, and the delay, that a fit does not adjust."""
    return tuple(n for n in (*SHAPE, SHARE, DELAY) if n in fit.model.values() and n not in fit.names)


def mode_is_inferred(model: Model) -> bool:
    """Whether a mode stands for a gain that changes with frequency, with assumed damping, because it does not ring."""
    return ExtraResonance.name in model and model[ExtraResonance.name]["zeta"] == SILENT_DAMPING


def rings_as_a_whole(model: Model) -> bool:
    """Whether there is a mode that rings and is that of the whole stage."""
    if ExtraResonance.name not in model or mode_is_inferred(model):
        return False
    mode = model[ExtraResonance.name]
    return abs(mode["r"] - 1.0) <= WHOLE and mode["zeta"] <= RINGS


def assumed_numbers(model: Model) -> tuple[str, ...]:
    """Numbers without an interval: those of an inferred mode, and the delay, which depends on its assumed damping."""
    return (*SHAPE, SHARE, DELAY) if mode_is_inferred(model) else ()


def lag_of_mode(model: Model) -> float:
    """By how much later a mode makes slow signals [s]; 0 without a mode."""
    if ExtraResonance.name not in model:
        return 0.0
    mode = model[ExtraResonance.name]
    return mode["r"] * mode["zeta"] / (np.pi * mode["f0"])


def mode_notices(fit: PieceFit) -> list[Notice]:
    """``ringing`` with the numbers of the mode, if there is one; one that does not ring has the assumed damping."""
    arx = dynamics_of(fit.model)
    rings = [p for p in arx.poles if p.imag >= 0.0 and _damping(p) <= RINGS and _share(p, arx) >= VISIBLE]
    if ExtraResonance.name not in fit.model:
        if not rings:
            return []
        order, line = arx.poles.size, _frequency(max(rings, key=lambda p: _share(p, arx)), fit.model)
        said = f"the stage rings after steps; ARX of order {order} describes its samples better than a mode does"
        return [Notice("ringing", f"{said}; they ring at {line:.4g} Hz{_alike(line, fit.model)}")]
    mode = fit.model[ExtraResonance.name]
    shown = f"a mode at {mode['f0']:.4g} Hz with"
    if not mode_is_inferred(fit.model):
        said = f"the stage rings after steps or sharp turns: {shown} a damping ratio of {mode['zeta']:.2g}"
        for pole in (p for p in rings if p.imag > 0.0):  # a negative pole is none of a mode that the samples show
            said += f", and one at {_frequency(pole, fit.model):.4g} Hz in the ARX dynamics with {_damping(pole):.2g}"
        if 1.0 / fit.model.sample_period < (1.0 + FARTHEST_ALIAS) * mode["f0"]:
            said += _alike(mode["f0"], fit.model)
    else:
        said = (
            f"the gain changes with the frequency of the drive; {shown} a share of {mode['r']:.3g} stands for this, "
            "but its frequency, damping and share and the delay are not determined separately and have no intervals"
        )
    return [Notice("ringing", said)]


def _share(pole: complex, arx: Arx) -> float:
    """Amplitude of what a pole contributes to the response to a step, as a share of the step."""
    away = np.delete(arx.poles, np.argmin(np.abs(arx.poles - pole)))
    residue = np.polyval(arx.array("b")[::-1], 1.0 / pole) / np.prod(1.0 - away / pole)
    pair = 2.0 if pole.imag > 0.0 else 1.0
    return float(pair * abs(residue / (1.0 - pole) / arx.dc_gain))


def _frequency(pole: complex, model: Model) -> float:
    """Natural frequency of a pole of the samples [Hz]."""
    return float(abs(np.log(pole)) / (2.0 * np.pi * model.sample_period))


def _alike(line: float, model: Model) -> str:
    """What is said of the alias of a line [Hz]."""
    alias = 1.0 / model.sample_period - line
    return (
        f"; a mode at {alias:.4g} Hz would give the same samples at this period of {model.sample_period:.3g} s (alias)"
    )


def _damping(pole: complex) -> float:
    """Damping ratio of a pole of the samples; 1 for one that is real and positive, or 0."""
    if pole == 0.0:
        return 1.0
    decay = np.log(pole)
    return float(-decay.real / abs(decay))
