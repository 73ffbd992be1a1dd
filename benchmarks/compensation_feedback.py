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

"""A PI controller on the simulated stage, for the benchmark of compensation.

The controller runs once per sample. Through Python a sample would take 30 µs, and the search for the best gains on a
path of 1 Hz several minutes, so the loop is compiled together with the kernels of the plant. Every search compares the
first samples with the stage itself.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

from piezo_hysteresis.blocks.kernel import kernel
from piezo_hysteresis.compensation import Limits
from piezo_hysteresis.stage.plant import PlantParameters
from piezo_hysteresis.stage.plant.creep import _relax
from piezo_hysteresis.stage.plant.electronics import _amplify
from piezo_hysteresis.stage.plant.hysteresis import _hysteresis
from piezo_hysteresis.stage.plant.plant import Plant
from piezo_hysteresis.stage.plant.structure import _vibrate
from piezo_hysteresis.stage.simulated import SimulatedStage

PERIOD = 2e-5
"""Sample period of stage and controller [s]."""
COMPARED = 300
"""Samples that are compared with the stage itself."""
TRIED = [(p, i) for p in (0.0, 0.1, 0.3, 0.6, 1.0) for i in (0.003, 0.01, 0.03, 0.1, 0.2, 0.4)]
"""Proportional and integral gains from the best of which the search starts."""
EVALUATIONS = 80
"""Largest number of further gains that the search tries."""


@kernel
def run_loop(wanted, per_metre, p_gain, i_gain, limits, dac, adc, amplifier, operator, bank, mechanics, y):
    """Displacement y (n,) [m] under feedback; the states inside the last four arguments are updated.

    `limits` are those of the drive [V]; dac and adc are (step, lowest, highest) of the converters.
    """
    held, oldest, holds, voltage_state, step, rails = amplifier
    scale, polynomial, loop, rate, backlash, radii, weights, loop_state, plays = operator
    active, kind, decay, early, late, start, bank_state, last = bank
    before, moved, push0, push1, force0, force1, spring, output, motion, last_w = mechanics
    u, x = np.empty(1), np.empty(1)
    v, w, crept = np.empty(step.size), np.empty(step.size), np.empty(step.size)
    total, reading = 0.0, 0.0
    for i in range(wanted.size):
        error = (wanted[i] - reading) * per_metre
        rough = wanted[i] * per_metre + p_gain * error + total
        u[0] = min(max(rough, limits[0]), limits[1])
        if u[0] == rough:  # no wind-up
            total += i_gain * error
        u[0] = min(max(np.rint(u[0] / dac[0]), dac[1]), dac[2]) * dac[0]
        _amplify(u, held, oldest, holds, voltage_state, step, rails, v)
        for j in range(v.size):
            v[j] /= scale
        _hysteresis(v, polynomial, loop, rate, backlash, radii, weights, step, loop_state, plays, w)
        if active:
            _relax(w, kind, decay, early, late, start, bank_state, last, crept)
        else:
            crept[:] = w
        _vibrate(crept, kind, before, moved, push0, push1, force0, force1, spring, output, motion, last_w, x)
        reading = min(max(np.rint(x[0] / adc[0]), adc[1]), adc[2]) * adc[0]
        y[i] = reading


def feedback(
    parameters: PlantParameters, wanted: np.ndarray, gains: tuple[float, float], per_metre: float, limits: Limits
) -> np.ndarray:
    """Displacement [m] under a PI controller that runs once per sample, beside the linear gain as feedforward.

    Parameters
    ----------
    parameters : PlantParameters
        The stage; converters, amplifier, hysteresis, creep and structure are simulated.
    wanted : (n,) ndarray
        Path [m].
    gains : (float, float)
        Proportional and integral gain, in units of `per_metre` and per sample.
    per_metre : float
        Slope of the stage [V/m].
    limits : Limits
        Of the drive.
    """
    plant, e, sensor = Plant(parameters, PERIOD), parameters.electronics, parameters.sensor
    a, o, b, m = plant._amplifier, plant._operator, plant._bank, plant._mechanics
    half = 2 ** (sensor.adc_bits - 1)
    lowest, highest = e.convert(np.array([limits.voltage_min, limits.voltage_max])) / e.lsb
    y, (p_gain, i_gain) = np.empty_like(wanted), gains
    run_loop(
        wanted,
        per_metre,
        p_gain,
        i_gain,
        (limits.voltage_min, limits.voltage_max),
        (e.lsb, np.rint(lowest), np.rint(highest)),
        (sensor.lsb, -float(half), half - 1.0),
        (a._held, a._oldest, a._holds, a._state, a._step, a._limits),
        (o._scale, o._polynomial, o._loop, o._rate, o._backlash, o._radii, o._weights, o._state, o._plays),
        (b.active, b._kind, b._decay, b._early, b._late, b._start, b._state, b._last),
        (m._before, m._transition, m._early, m._late, m._force0, m._force1, m._spring, m._output, m._state, m._last),
        y,
    )
    return y


def feedback_through_stage(
    parameters: PlantParameters, wanted: np.ndarray, gains: tuple[float, float], per_metre: float, limits: Limits
) -> np.ndarray:
    """`feedback`, sample by sample through the stage itself."""
    stage = SimulatedStage(parameters)
    total, y, u = 0.0, np.empty_like(wanted), np.empty(1)
    reading = 0.0
    for i in range(wanted.size):
        error = (wanted[i] - reading) * per_metre
        rough = wanted[i] * per_metre + gains[0] * error + total
        u[0] = min(max(rough, limits.voltage_min), limits.voltage_max)
        if u[0] == rough:
            total += gains[1] * error
        reading = float(stage.exchange(u).displacement[0])
        y[i] = reading
    return y


def best_feedback(
    parameters: PlantParameters, wanted: np.ndarray, part: slice, per_metre: float, limits: Limits
) -> tuple[float, tuple[float, float]]:
    """Smallest rms error over `part` of the path [m], and the gains: the best of `TRIED`, then by the simplex method.

    Raises
    ------
    RuntimeError
        If the compiled loop and the stage differ.
    """
    start = wanted[:COMPARED]
    loop = parameters, start, (0.3, 0.03), per_metre, limits
    if not np.array_equal(feedback(*loop), feedback_through_stage(*loop)):
        raise RuntimeError("the compiled loop differs from the stage; expected a stage without effects of time")

    def rms(gains: tuple[float, float]) -> float:
        y = feedback(parameters, wanted, (abs(gains[0]), abs(gains[1])), per_metre, limits)
        return float(np.sqrt(np.mean((y - wanted)[part] ** 2)))

    best = min(TRIED, key=rms)
    simplex = [best, (best[0] + 0.1, best[1]), (best[0], 1.3 * best[1])]
    options = {"initial_simplex": simplex, "maxfev": EVALUATIONS, "xatol": 1e-3, "fatol": 1e-13}
    found = minimize(rms, best, method="Nelder-Mead", options=options)
    return float(found.fun), (abs(float(found.x[0])), abs(float(found.x[1])))
