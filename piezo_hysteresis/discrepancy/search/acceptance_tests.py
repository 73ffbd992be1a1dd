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

"""Acceptance tests: reasons to reject an effect although it improves the prediction."""

from __future__ import annotations

import math

import numpy as np
from scipy.special import chdtri

from ...effects import AmplifierSaturation, Backlash, Creep, MainsHum
from ...identification.fit.cross_validation import Score
from ...identification.fit.form_uncertainty import with_form_uncertainty
from ...identification.records.noise_floor import ADEQUATE, stroke
from ...identification.training.mains_frequency import RESOLVED
from .candidate_refits import LEAST_GAIN
from .candidates import FittedCandidate
from .refit import without

PERIODS, FEWEST = 2.0, 4
"""Smallest number of mains periods in a record, smallest number of records."""
STEADY = 0.3
"""Smallest share of the gain of hum that hum of the lower quartile of its power explains."""
UNCERTAIN = 0.05
"""Probability of a size at least as large without the effect, up to which the effect is certain."""
PEAKS = 3.0
"""Standard deviations that noise hardly exceeds."""


def first_rejection(best: FittedCandidate, before: Score) -> str | None:
    """First reason to reject a fitted candidate; None if it passes all tests. The cheap tests come first."""
    gain = before.cost - best.score.cost
    if gain < LEAST_GAIN:
        return f"in cross-validation it lowers mean ln R² by {_below(gain)}, and a decrease by {LEAST_GAIN:g} is needed"
    if best.name == MainsHum.name and not is_steady(best, before):
        return "its amplitude depends on the drive, which mains hum does not"
    if best.effect.family == Creep.family and "gamma" in best.effect.values and best.effect["gamma"] < 0.0:
        return "its γ is negative, and no material creeps back"
    if not exceeds_voltage_noise(best):
        return "it changes the voltage no more than the noise with which it was measured"
    alone = without(best)
    owed = LEAST_GAIN if alone is None else alone.score.cost - best.score.cost
    if owed < LEAST_GAIN:
        return f"it gains {_below(owed)} over the model that was refitted without it, and {LEAST_GAIN:g} is needed"
    if before.excess <= ADEQUATE and not is_certain(best):
        return "the error is at the floor, and its interval does not exclude that it is absent"
    return None


def _below(gain: float) -> str:
    """A gain, rounded down to two decimals, so that a number below a limit looks below it; 0.00 for a loss."""
    return f"{math.floor(100.0 * max(0.0, gain)) / 100.0:.2f}"


def is_certain(candidate: FittedCandidate) -> bool:
    """Whether the size of an effect differs from none by more than the uncertainty of the model's form.

    A Wald test of all its numbers that are known when the effect is off, with the others, such as a time constant, as
    they were found: without the effect they do not exist, and a size may be known only together with them. They count
    as degrees of freedom. Hum, which is free in every record, has none. A limit that is never reached has no influence.
    """
    data, model = candidate.training_data, candidate.fit.model
    noise = data.floors if data.noise is None else data.noise
    free, span = data.free_with(model), stroke(data.records)
    fit = with_form_uncertainty(candidate.fit, data.records, free, data.floors, noise, span)
    now, off = fit.values, model.with_effect(candidate.effect.off()).values()
    fitted = [n for n in fit.names if n.partition(".")[0] == candidate.name]
    own = [n for n in fitted if fit.standard_errors[n] > 0.0]
    sizes = [n for n in own if model.row(n).off is not None]
    if not sizes:
        return not fitted
    precision = np.linalg.pinv([[fit.correlation(n, m) for m in own] for n in own], hermitian=True)
    away = np.array([(now[n] - off[n]) / fit.standard_errors[n] if n in sizes else 0.0 for n in own])
    return bool(away @ precision @ away > chdtri(len(own), UNCERTAIN))


def is_steady(hum: FittedCandidate, before: Score) -> bool:
    """Whether hum of the same amplitude in every record, which does not depend on the drive, explains what is gained.

    Hum is free in every record, also in those that cross-validation leaves out. It can take up what another effect
    leaves at the mains frequency and its harmonics, in the records whose drive moves at them.
    """
    data, frequency = hum.training_data, hum.effect["f"]
    lines = 2 * data.free_with(hum.fit.model).harmonics
    powers = np.array([0.5 * np.sum(free[-lines:] ** 2) for free in hum.fit.nuisances])
    counted = np.isfinite(data.floors)
    shown = counted & [  # long and fast enough to show hum
        r.duration * frequency >= PERIODS and r.sample_period * frequency <= RESOLVED for r in data.records
    ]
    if np.sum(shown) < FEWEST:
        return True
    kept = shown[counted]
    left = data.floors[shown] ** 2 * np.exp(hum.score.logs[kept])
    owed = np.log1p(np.quantile(powers[shown], 0.25) / left)
    return bool(np.mean(owed) > STEADY * np.mean((before.logs - hum.score.logs)[kept]))


def exceeds_voltage_noise(candidate: FittedCandidate) -> bool:
    """Whether a backlash or a limit changes the voltage by more than the noise with which it was measured.

    The stage has not seen what is left of this noise. A narrow play or a limit at the lowest voltage hides it.
    """
    effect, records = candidate.effect, candidate.training_data.records
    noise = max((record.voltage_noise for record in records), default=0.0)
    if noise == 0.0 or effect.name not in (Backlash.name, AmplifierSaturation.name):
        return True
    if effect.name == Backlash.name:
        return bool(effect["b"] > PEAKS * noise)
    cut = (np.clip(r.voltage, effect["lower"], effect["upper"]) - r.voltage for r in records)
    return bool(max(float(np.sqrt(np.mean(c**2))) for c in cut) > PEAKS * noise)
