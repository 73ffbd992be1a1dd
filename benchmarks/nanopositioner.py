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

"""A third simulated stage, similar to measured nanopositioners; it shares no code with `effects` or `stage`.

Plays whose weights depend on the level, cubic and square, creep of one rate before and another after about a third of a
second, a lightly damped mode or two, a pole and a delay, and what a lab changes between two recordings: a filter, a
delay, a softer spring, a drift, half a per cent from day to day. Everything runs on a grid finer than the samples; the
converter holds every sample, and a record begins with a step from 0 V, holds, and goes on with sines that grow.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.signal import butter, cont2discrete, lfilter

from piezo_hysteresis.blocks.kernel import kernel
from piezo_hysteresis.record import Record

Array = np.ndarray

FINER = 8
"""Approximate number of steps of the plant per sample."""
TURN = 0.3
"""Time at which creep turns from its fast rate to its slow one [s]."""
RINGS = 1.0
"""Time after which no stage rings any more [s]."""
DRIFT = 10.0
"""Time in which a stage drifts by `drift` [s]."""
PER_DECADE = 6
"""Creep elements per decade."""


@kernel
def level_plays(v, radii, weights, bends):
    """Σ w_j f_j(p_j), f_j(p) = p + b_j p², of plays that start virgin at 0."""
    out = np.zeros(v.size)
    state = np.zeros(radii.size)
    for i in range(v.size):
        for j in range(radii.size):
            state[j] = min(max(state[j], v[i] - radii[j]), v[i] + radii[j])
            out[i] += weights[j] * (state[j] + bends[j] * state[j] * state[j])
    return out


@kernel
def slewed(v, reach):
    """The drive behind an amplifier that changes by at most `reach` per step of the plant, from 0."""
    out, held = np.empty(v.size), 0.0
    for i in range(v.size):
        held = min(max(v[i], held - reach), held + reach)
        out[i] = held
    return out


@kernel
def elements(w, dt, taus, weights):
    """Σ of weighted first-order elements that were settled at 0."""
    out = np.zeros(w.size)
    state = np.zeros(taus.size)
    keep = np.exp(-dt / taus)
    for i in range(w.size):
        for j in range(taus.size):
            state[j] = w[i] + (state[j] - w[i]) * keep[j]
            out[i] += weights[j] * state[j]
    return out


@dataclass(frozen=True)
class Nanopositioner:
    """A stage; lengths relative to the stroke, voltages to `volt`, times in s."""

    stroke: float = 5e-5
    volt: float = 10.0
    loop: float = 0.25
    width: float = 0.12
    bend: float = 0.15
    cubic: float = -0.08
    square: float = 0.1
    creep_fast: float = 0.008
    creep_slow: float = 0.014
    mode: float = 600.0
    zeta: float = 0.03
    second_share: float = 0.0
    second_mode: float = 1000.0
    pole: float = 1e-4
    delay: float = 6e-5
    noise: float = 2e-4
    zero: float = 1e-6
    gain: float = 1.0
    slew: float = 0.0
    filter_drive: float = 0.0
    filter_delay: float = 0.0
    filter_pole: float = 0.0
    filter_twice: float = 0.0
    filter_mean: float = 0.0
    softening: float = 0.0
    drift: float = 0.0
    plays: int = 30
    seed: int = field(default=0, compare=False)
    noise_seed: int = field(default=0, compare=False)

    @classmethod
    def random(cls, rng: np.random.Generator, **fixed: float) -> Nanopositioner:
        """A stage with all its numbers drawn."""

        def between(low: float, high: float) -> float:
            return float(np.exp(rng.uniform(np.log(low), np.log(high))))

        drawn = {
            "stroke": between(1e-5, 1e-4),
            "loop": between(0.15, 0.35),
            "width": between(0.06, 0.25),
            "bend": float(rng.uniform(-0.2, 0.3)),
            "cubic": float(rng.uniform(-0.12, 0.05)),
            "square": float(rng.uniform(-0.05, 0.15)),
            "creep_fast": between(0.005, 0.012),
            "creep_slow": between(0.008, 0.02),
            "mode": between(250.0, 1200.0),
            "zeta": between(0.01, 0.05),
            "pole": between(2e-5, 3e-4),
            "delay": between(2e-5, 3e-4),
            "zero": float(rng.uniform(-1e-6, 1e-6)),
            "seed": int(rng.integers(1 << 30)),
        }
        return cls(**{**drawn, **fixed})

    def on_another_day(self, rng: np.random.Generator, size: float = 0.005) -> Nanopositioner:
        """The same stage, its gain, loop and zero changed a little."""
        gain, loop = 1.0 + size * rng.uniform(-1.0, 1.0, 2)
        zero = self.zero + 0.01 * self.stroke * float(rng.normal())
        noise = int(rng.integers(1 << 30))
        return replace(self, gain=self.gain * gain, loop=self.loop * loop, zero=zero, noise_seed=noise)

    def play(self, drive: Array, period: float, phase: str = "record") -> Record:
        """Record of a drive [V] that follows a rest at 0 V, sampled at `period` [s]."""
        dt = period / FINER
        v = np.repeat(drive, FINER) / self.volt
        if self.slew:
            v = slewed(v, self.slew * dt / self.volt)
        v = self._late(v, 0.0, self.filter_drive, dt)
        x = self._mechanics(self._creep(self._hysteresis(v), dt), dt)
        if self.softening:
            for _ in range(3):
                x = x / (1.0 + self.softening * x * x) if _ == 0 else x
        y = self._filtered(x, dt)
        rng = np.random.default_rng((self.seed, self.noise_seed, drive.size))
        at = y[::FINER]
        t = period * np.arange(at.size)
        at = at + self.drift * t / DRIFT + self.noise * rng.normal(size=at.size)
        return Record(drive, self.zero + self.stroke * self.gain * at, period, phase=phase, initial_voltage=0.0)

    def _hysteresis(self, v: Array) -> Array:
        radii = np.geomspace(0.004, 0.9, self.plays)
        weights = np.gradient(radii) * np.exp(-radii / self.width)
        weights *= self.loop / weights.sum()
        spread = np.random.default_rng(self.seed).normal(1.0, 0.1, self.plays)
        held = level_plays(v, radii, weights * spread, self.bend * np.linspace(0.7, 1.3, self.plays))
        return np.asarray((1.0 - self.loop) * v + self.square * v**2 + self.cubic * v**3 + held)

    def _creep(self, w: Array, dt: float) -> Array:
        taus = 10.0 ** np.arange(-4.0, 3.01, 1.0 / PER_DECADE)
        share = 1.0 / (1.0 + (TURN / taus) ** 2)
        rates = (self.creep_fast * (1.0 - share) + self.creep_slow * share) / PER_DECADE
        early = float(rates @ (1.0 - np.exp(-0.1 / taus)))
        return np.asarray((1.0 - early) * w + elements(w, dt, taus, rates))

    def sampled_lag(self, period: float) -> float:
        """Group delay of the samples at low frequency [s], with that of the converter: Σ (1 − s_k) of the step s.

        A mode near a multiple of the sampling rate resonates with the steps of the converter, so that the samples have
        another lag than that of the stage and half a sample.
        """
        exact = replace(self, slew=0.0, zero=0.0, noise=0.0, softening=0.0, drift=0.0)
        linear = replace(exact, loop=0.0, bend=0.0, cubic=0.0, square=0.0, creep_fast=0.0, creep_slow=0.0)
        response = linear.play(np.full(round(RINGS / period), self.volt), period).displacement
        return float(period * np.sum(1.0 - response / response[-1]))

    def _mechanics(self, w: Array, dt: float) -> Array:
        x = (1.0 - self.second_share) * self._resonant(w, self.mode, dt)
        if self.second_share:
            x += self.second_share * self._resonant(w, self.second_mode, dt)
        return self._late(x, self.delay, self.pole, dt)

    def _resonant(self, w: Array, frequency: float, dt: float) -> Array:
        o = 2.0 * np.pi * frequency
        system = ([[0.0, 1.0], [-o * o, -2.0 * self.zeta * o]], [[0.0], [o * o]], [[1.0, 0.0]], [[0.0]])
        a, b, c, _, _ = cont2discrete(tuple(np.array(m) for m in system), dt)
        den = np.poly(a)
        return np.asarray(lfilter(np.poly(a - b @ c) - den, den, w))

    def _filtered(self, x: Array, dt: float) -> Array:
        if self.filter_mean:  # the mean of the last samples, which is so much later
            taps = 1 + round(2.0 * self.filter_mean / dt)
            x = lfilter(np.full(taps, 1.0 / taps), [1.0], x)
        if self.filter_twice:
            x = lfilter(*butter(2, 0.5 / (np.pi * self.filter_twice), fs=1.0 / dt), x)
        return self._late(x, self.filter_delay, self.filter_pole, dt)

    @staticmethod
    def _late(x: Array, delay: float, pole: float, dt: float) -> Array:
        if delay:
            now = np.arange(x.size)
            x = np.interp(now - delay / dt, now, x, left=0.0)
        if pole:
            half = 0.5 * dt / pole  # trapezoidal: the lag is that of the pole, whatever the grid
            x = lfilter([half / (1.0 + half)] * 2, [1.0, -(1.0 - half) / (1.0 + half)], x)
        return x


def growing_sine(
    frequency: float,
    period: float,
    levels: tuple[float, ...] = (0.2, 0.4, 0.6, 0.8, 1.0),
    *,
    volt: float = 10.0,
    cycles: int = 2,
    hold: float = 0.4,
    triangle: bool = False,
) -> Array:
    """Step from 0 V to the middle in the first sample, a hold, then sines whose amplitude grows [V]."""
    middle = 0.5 * volt
    size = round(cycles / (frequency * period))
    phase = 2.0 * np.pi * frequency * period * np.arange(size)
    wave = 2.0 / np.pi * np.arcsin(np.sin(phase)) if triangle else np.sin(phase)
    parts = [np.full(round(hold / period), middle), *(middle + level * middle * 0.95 * wave for level in levels)]
    return np.concatenate(parts)
