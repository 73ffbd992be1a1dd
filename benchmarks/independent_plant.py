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

"""A second simulated stage for the benchmarks: shares no code with `effects` or `stage`, and integrates differently.

Hysteresis by the midpoint rule on a finely cut drive (or plays by direct superposition), creep as many Kelvin-Voigt
elements (five per decade, or a power law), linear dynamics as continuous modes. Slow phases run on a finer grid with
quasi-static dynamics and are block-averaged; a `thorough` plant runs them at the fastest period, dynamics and all.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.signal import cont2discrete, lfilter

from benchmarks import independent_kernels as kernels
from piezo_hysteresis.record import Record

NATIVE = 2e-5
"""Fastest sample period [s]."""

Array = np.ndarray
Unknown = Callable[["Plant", Array, Array, Array], Array]
"""(plant, drive [V], reading [m], time [s]) → reading with an effect that is not in the catalogue."""


@dataclass(frozen=True)
class Plant:
    """Parameters of the plant; lengths relative to the stroke, times in s, `hidden` the effects switched on."""

    A: float = -0.77
    beta: float = 4.6
    gamma: float = -0.87
    p1: float = -0.11
    p2: float = 2.2
    plays: bool = False
    f1: float = 1400.0
    zeta1: float = 0.35
    f2: float = 3300.0
    zeta2: float = 0.1
    share2: float = 0.15
    delay: float = 6e-5
    stroke: float = 30e-6
    volt: float = 10.0
    noise: float = 5e-4
    zero: float = 2e-6
    hidden: Mapping[str, Any] = field(default_factory=dict)
    thorough: bool = False
    explicit: bool = False

    @classmethod
    def random(cls, rng: np.random.Generator, **fixed: Any) -> Plant:
        """Parameters near the published ones, with another value for each."""

        def near(value: float, spread: float) -> float:
            return float(value * np.exp(rng.uniform(-spread, spread)))

        beta = near(4.6, 0.4)
        drawn = {
            "A": -near(0.77, 0.3),
            "beta": beta,
            "gamma": float(rng.uniform(-0.5, 0.5)) * beta,
            "p1": -near(0.11, 0.5),
            "p2": near(2.2, 0.15),
            "f1": near(1400, 0.3),
            "zeta1": near(0.35, 0.4),
            "f2": near(3300, 0.2),
            "zeta2": near(0.1, 0.5),
            "share2": float(rng.uniform(0.05, 0.2)),
            "delay": NATIVE * int(rng.integers(2, 5)),
            "stroke": near(30e-6, 1.0),
        }
        return cls(**{**drawn, **fixed})

    def play(
        self,
        drive: Array,
        period: float,
        phase: str,
        rng: np.random.Generator,
        start_time: float = 0.0,
        averaged: int = 1,
    ) -> Record:
        """Record of a phase that begins settled at its first voltage; `averaged` samples become one."""
        u = np.asarray(drive, float)
        if self.thorough and period > 1.01 * NATIVE:
            finer = round(period / NATIVE)
            u = np.interp(np.arange(u.size * finer) / finer, np.arange(u.size), u)
            period, averaged = NATIVE, averaged * finer
        t = start_time + period * np.arange(u.size)
        slow = period > 1.01 * NATIVE
        v, lag = self._amplifier(u, period, slow)
        w, w0 = self._hysteresis(v / self.volt, u[0] / self.volt, period)
        w, w0 = self._creep(w, w0, period)
        x = self._quasi_static(w, w0, period, lag) if slow else self._dynamic(w, w0, period, lag)
        y, other = self._sensor(x / (self.p2 + self.p1), t, period, slow, rng)
        if "unknown" in self.hidden:
            y = self.hidden["unknown"](self, u, y, t)
        y = y + self.noise * self.stroke * rng.normal(size=u.size) * np.sqrt(min(1.0, NATIVE / period))
        others = {} if other is None else {"other_displacement": other}
        record = Record(u, y, period, phase=phase, start_time=start_time, channels=others)
        return record.decimate(averaged) if averaged > 1 else record

    def _amplifier(self, u: Array, dt: float, slow: bool) -> tuple[Array, float]:
        """Voltage at the piezo [V], and what lag is left to the dynamics [s]."""
        e, lag = self.hidden, self.hidden.get("extra_delay", 0.0)
        x = u
        if "amplifier_bandwidth" in e:
            tau = e["amplifier_bandwidth"]
            if slow:
                lag += tau
            else:
                keep = np.exp(-dt / tau)
                x = u[0] + lfilter([1 - keep], [1, -keep], x - u[0])
        if "amplifier_slew_limit" in e:
            x = kernels.slew(x, u[0], e["amplifier_slew_limit"] * self.volt * dt)
        if "amplifier_saturation" in e:
            top, corner = (self.volt * q for q in e["amplifier_saturation"])
            x = x - corner * np.logaddexp(0.0, (x - top) / corner)
        return x, lag

    def _hysteresis(self, v: Array, v0: float, dt: float) -> tuple[Array, float]:
        e = self.hidden
        if "backlash" in e:
            v = v0 + kernels.plays(v, v0, np.array([e["backlash"]]), np.ones(1))
        if self.plays:
            radii = np.linspace(0.01, 0.35, 14)
            weights = 0.16 * np.exp(-radii / 0.15)
            linear = self.p2 - weights.sum()
            w = linear * v + self.p1 * v**3 + kernels.plays(v, v0, radii, weights) + v0 * weights.sum()
            w0 = self.p2 * v0 + self.p1 * v0**3
        else:
            h0 = e.get("initial_state", 0.0)
            phi1, phi2 = e.get("asymmetric_hysteresis", (0.0, 0.0))
            k, a = e.get("rate_dependent_hysteresis", (0.0, 0.5))
            n = e.get("hysteresis_exponent", 1.0)
            if self.explicit:
                h = kernels.explicit_bouc_wen(v, v0, self.A, self.beta, self.gamma, h0)
            else:
                h = kernels.bouc_wen(v, v0, dt, self.A, self.beta, self.gamma, phi1, phi2, n, k, a, h0)
            w, w0 = self.p1 * v**3 + self.p2 * v + h, self.p1 * v0**3 + self.p2 * v0 + h0
        if "even_input_polynomial" in e:
            w, w0 = w + e["even_input_polynomial"] * v**2, w0 + e["even_input_polynomial"] * v0**2
        if "hysteresis_memory" in e:
            radii = np.linspace(0.02, 0.3, 9)
            weights = e["hysteresis_memory"] * np.exp(-radii / 0.1) * (1 + 0.5 * np.cos(9 * radii))
            w = w + kernels.plays(v, v0, radii, weights) + v0 * weights.sum()
            w0 += v0 * weights.sum()
        return w, w0

    def _creep(self, w: Array, w0: float, dt: float) -> tuple[Array, float]:
        if "creep" not in self.hidden:
            return w, w0
        kind, size = self.hidden["creep"]
        if kind == "exponential":
            taus, weights, done = np.array([0.08, 3.0]), np.array([size, 0.7 * size]), 0.0
        else:
            taus = 10.0 ** np.arange(-5, 4.01, 0.2)
            weights = 0.2 * size * taus ** (0.15 if kind == "fractional" else 0.0)
            done = float((weights * (1 - np.exp(-0.1 / taus))).sum())
        return (1 - done) * w + kernels.relax(w, w0, dt, taus, weights), w0 * (1 - done + weights.sum())

    def _quasi_static(self, w: Array, w0: float, dt: float, lag: float) -> Array:
        lag += self.delay + 2 * self.zeta1 / (2 * np.pi * self.f1)
        now = np.arange(w.size)
        load = np.interp(now - lag / dt, now, w, left=w0)
        return self._spring_rest(load) if "softening" in self.hidden else load

    def _spring_rest(self, load: Array | float) -> Array | float:
        k2, k3 = self.hidden["softening"]
        x = load
        for _ in range(50):
            x = load / (1 + k2 * np.abs(x) + k3 * x * x)
        return x

    def _dynamic(self, w: Array, w0: float, dt: float, lag: float) -> Array:
        whole, part = divmod((lag + self.delay) / dt, 1.0)
        delayed = np.concatenate((np.full(int(whole) + 1, w0), w))
        d = (1 - part) * delayed[1 : 1 + w.size] + part * delayed[: w.size]
        if "softening" in self.hidden:
            k2, k3 = self.hidden["softening"]
            x = kernels.spring(d, float(self._spring_rest(w0)), dt, self.f1, self.zeta1, k2, k3)
        else:
            x = _mode(d, w0, dt, self.f1, self.zeta1)
        x = (1 - self.share2) * x + self.share2 * _mode(x, x[0], dt, self.f2, self.zeta2)
        if "extra_resonance" in self.hidden:
            f, zeta, share = self.hidden["extra_resonance"]
            x = x + share * (_mode(x, x[0], dt, f, zeta) - x)
        return x

    def _sensor(
        self, q: Array, t: Array, dt: float, slow: bool, rng: np.random.Generator
    ) -> tuple[Array, Array | None]:
        """Reading [m] of a displacement relative to the stroke, and the other axis [m]."""
        e = self.hidden
        if "sensor_nonlinearity" in e:
            s2, s3 = e["sensor_nonlinearity"]
            q = q + s2 * q**2 + s3 * q**3
        if "gain_drift" in e:
            g, tau = e["gain_drift"]
            q = q * (1 + g * (1 - np.exp(-t / tau)))
        if "sensor_bandwidth" in e:
            keep, now = np.exp(-dt / e["sensor_bandwidth"]), np.arange(q.size)
            late = np.interp(now - e["sensor_bandwidth"] / dt, now, q)
            q = late if slow else q[0] + lfilter([1 - keep], [1, -keep], q - q[0])
        y = q * self.stroke + self.zero
        if "thermal_drift" in e:
            d, tau = e["thermal_drift"]
            y = y + self.stroke * d * (1 - np.exp(-t / tau))
        if "mains_hum" in e:
            f, size = e["mains_hum"]
            p = rng.uniform(0, 2 * np.pi, 2)
            y = y + self.stroke * size * (np.cos(2 * np.pi * f * t + p[0]) + 0.4 * np.cos(4 * np.pi * f * t + p[1]))
        if "axis_coupling" not in e:
            return y, None
        wander = np.convolve(rng.normal(size=q.size + 400), np.hanning(401) / 15, "valid")[: q.size]
        other = 0.5 * self.stroke * wander
        return y + e["axis_coupling"] * other, other


def _mode(u: Array, u0: float, dt: float, f: float, zeta: float) -> Array:
    """Resonance with unit dc gain, zero-order hold, settled at `u0`."""
    o = 2 * np.pi * f
    a, b, c, *_ = cont2discrete(
        (np.array([[0, 1], [-o * o, -2 * zeta * o]]), np.array([[0], [o * o]]), np.eye(1, 2), np.zeros((1, 1))), dt
    )
    den = np.poly(a)
    return u0 + lfilter(np.poly(a - b @ c) - den, den, u - u0)
