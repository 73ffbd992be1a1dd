"""A second simulated stage for the benchmarks: shares no code with `effects` or `stage`, and integrates differently.

Hysteresis by the midpoint rule on a finely interpolated drive (or plays by direct superposition), creep as many
Kelvin-Voigt elements (five per decade, or a power law), linear dynamics as a continuous state space. Slow phases are run
on a grid ten times finer with quasi-static dynamics and block-averaged.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numba
import numpy as np
from scipy.signal import cont2discrete, lfilter

from piezo_hysteresis.record import Experiment, Record

NATIVE = 2e-5
VOLT = 10.0


@numba.njit(cache=True)
def _bouc_wen(v, start, dt, A, beta, gamma, phi1, phi2, n, k, a, h):
    out = np.empty(v.size)
    last = start
    for i in range(v.size):
        step = v[i] - last
        last = v[i]
        count = max(1, int(abs(step) / 2e-4))
        dv = step / count
        speed = abs(step) / dt
        slope = A
        if k != 0.0 and speed > 0.0:
            slope = A * (1.0 + k * ((max(speed, 1e-4) ** a - 1.0) / a))
        for _ in range(count):
            p = 1.0 if n == 1.0 else (abs(h) / 0.2) ** (n - 1.0)
            d1 = slope * dv - p * (beta * abs(dv) * h + gamma * dv * abs(h)) + phi1 * dv * h + phi2 * abs(dv) * abs(h)
            m = h + 0.5 * d1
            p = 1.0 if n == 1.0 else (abs(m) / 0.2) ** (n - 1.0)
            h += slope * dv - p * (beta * abs(dv) * m + gamma * dv * abs(m)) + phi1 * dv * m + phi2 * abs(dv) * abs(m)
        out[i] = h
    return out


@numba.njit(cache=True)
def _plays(v, start, radii, weights):
    out = np.zeros(v.size)
    state = np.full(radii.size, start)
    for i in range(v.size):
        for j in range(radii.size):
            state[j] = min(max(state[j], v[i] - radii[j]), v[i] + radii[j])
            out[i] += weights[j] * (state[j] - start)
    return out


@numba.njit(cache=True)
def _slew(u, start, step):
    out = np.empty(u.size)
    y = start
    for i in range(u.size):
        y += min(max(u[i] - y, -step), step)
        out[i] = y
    return out


@numba.njit(cache=True)
def _relax(w, start, dt, taus, weights):
    out = np.zeros(w.size)
    x = np.full(taus.size, start)
    keep = np.exp(-dt / taus)
    for i in range(w.size):
        for j in range(taus.size):
            x[j] = w[i] + (x[j] - w[i]) * keep[j]
            out[i] += weights[j] * x[j]
    return out


@numba.njit(cache=True)
def _spring(w, x0, dt, f0, zeta, k2, k3):
    """Mode with a nonlinear spring, ten semi-implicit sub-steps per sample."""
    out = np.empty(w.size)
    x, s = x0, 0.0
    h = dt / 10
    o = 2 * np.pi * f0
    for i in range(w.size):
        for _ in range(10):
            s += h * (o * o * (w[i] - x * (1 + k2 * abs(x) + k3 * x * x)) - 2 * zeta * o * s)
            x += h * s
        out[i] = x
    return out


@dataclass(frozen=True)
class Plant:
    """Parameters of the plant; `hidden` holds those of the effects that are switched on."""

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
    gain: float = 0.24641
    stroke: float = 30e-6
    noise: float = 5e-4
    zero: float = 2e-6
    hidden: dict = field(default_factory=dict)

    @classmethod
    def random(cls, rng: np.random.Generator, **fixed) -> Plant:
        """Parameters around the published ones, all of them different."""

        def near(value, spread):
            return float(value * np.exp(rng.uniform(-spread, spread)))

        beta = near(4.6, 0.4)
        return cls(
            **{
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
                **fixed,
            }
        )

    def play(self, u, dt, phase, rng, start_time=0.0, settled=None, averaged=1) -> Record:
        """A phase from rest; `averaged` samples of the fine grid dt are averaged into one."""
        e = self.hidden
        u = np.asarray(u, float)
        u0 = u[0] if settled is None else settled
        slow = dt > 1.01 * NATIVE
        t = start_time + dt * np.arange(u.size)
        full = self.gain * (self.p2 + self.p1)
        x = u
        lag = e.get("extra_delay", 0.0)
        if "amplifier_bandwidth" in e:
            tau = e["amplifier_bandwidth"]
            if slow:
                lag += tau
            else:
                keep = np.exp(-dt / tau)
                x = u0 + lfilter([1 - keep], [1, -keep], x - u0)
        if "amplifier_slew_limit" in e:
            x = _slew(x, u0, e["amplifier_slew_limit"] * dt)
        if "amplifier_saturation" in e:
            top, corner = e["amplifier_saturation"]
            x = x - corner * np.logaddexp(0.0, (x - top) / corner)
        v, v0 = x / VOLT, u0 / VOLT
        if "backlash" in e:
            v = v0 + _plays(v, v0, np.array([e["backlash"] / VOLT]), np.ones(1))
        phi1, phi2 = e.get("asymmetric_hysteresis", (0.0, 0.0))
        k, a = e.get("rate_dependent_hysteresis", (0.0, 0.5))
        h0 = e.get("initial_state", 0.0)
        if self.plays:
            radii = np.linspace(0.01, 0.35, 14)
            weights = 0.16 * np.exp(-radii / 0.15)
            w = (self.p2 - 1.4) * v + self.p1 * v**3 + _plays(v, v0, radii, weights) + v0 * weights.sum()
        else:
            h = _bouc_wen(
                v, v0, dt, self.A, self.beta, self.gamma, phi1, phi2, e.get("hysteresis_exponent", 1.0), k, a, h0
            )
            w = self.p1 * v**3 + self.p2 * v + h
        w0 = self.p1 * v0**3 + (self.p2 if not self.plays else self.p2 - 1.4 + weights.sum()) * v0 + (0 if self.plays else h0)
        if "even_input_polynomial" in e:
            w, w0 = w + e["even_input_polynomial"] * v**2, w0 + e["even_input_polynomial"] * v0**2
        if "hysteresis_memory" in e:
            radii = np.linspace(0.02, 0.3, 9)
            w = w + _plays(v, v0, radii, e["hysteresis_memory"] * np.exp(-radii / 0.1) * (1 + 0.5 * np.cos(9 * radii)))
        if "creep" in e:
            kind, size = e["creep"]
            if kind == "logarithmic":
                taus = 10.0 ** np.arange(-5, 4.01, 0.2)
                weights = np.full(taus.size, 0.2 * size)
            elif kind == "fractional":
                taus = 10.0 ** np.arange(-5, 4.01, 0.2)
                weights = 0.2 * size * (taus / 1.0) ** 0.15
            else:
                taus, weights = np.array([0.08, 3.0]), np.array([size, 0.7 * size])
            at = (weights * (1 - np.exp(-0.1 / taus))).sum() if kind != "exponential" else 0.0
            w = (1 - at) * w + _relax(w, w0, dt, taus, weights)
            w0 = w0 * (1 - at + weights.sum())
        x = self._dynamics(w, w0, dt, slow, lag) * self.gain
        if "sensor_nonlinearity" in e:
            s2, s3 = e["sensor_nonlinearity"]
            q = x / full
            x = x + full * (s2 * q**2 + s3 * q**3)
        if "gain_drift" in e:
            g, tau = e["gain_drift"]
            x = x * (1 + g * (1 - np.exp(-t / tau)))
        if "sensor_bandwidth" in e and not slow:
            keep = np.exp(-dt / e["sensor_bandwidth"])
            x = x[0] + lfilter([1 - keep], [1, -keep], x - x[0])
        elif "sensor_bandwidth" in e:
            back = np.arange(x.size) - e["sensor_bandwidth"] / dt
            x = np.interp(back, np.arange(x.size), x)
        y = x / full * self.stroke + self.zero
        if "thermal_drift" in e:
            d, tau = e["thermal_drift"]
            y = y + self.stroke * d * (1 - np.exp(-t / tau))
        if "mains_hum" in e:
            f, size = e["mains_hum"]
            p = rng.uniform(0, 6.28, 2)
            y = y + self.stroke * size * (np.cos(2 * np.pi * f * t + p[0]) + 0.4 * np.cos(4 * np.pi * f * t + p[1]))
        other = None
        if "axis_coupling" in e:
            other = self.stroke * 0.5 * np.convolve(rng.normal(size=u.size + 400), np.hanning(401) / 15, "valid")[: u.size]
            y = y + e["axis_coupling"] * other
        if "unknown" in e:
            y = e["unknown"](self, u, y, t, dt)
        y = y + self.noise * self.stroke * rng.normal(size=u.size) * np.sqrt(max(1.0, dt / NATIVE))** -1
        record = Record(
            u, y, dt, phase=phase, start_time=start_time, initial_voltage=settled,
            other_displacement=other,
        )
        return record.decimate(averaged) if averaged > 1 else record

    def _dynamics(self, w, w0, dt, slow, extra):
        e = self.hidden
        lag = self.delay + extra
        if slow:
            k2, k3 = e.get("softening", (0.0, 0.0))
            lag += 2 * self.zeta1 / (2 * np.pi * self.f1)
            x = np.interp(np.arange(w.size) - lag / dt, np.arange(w.size), w, left=w0)
            for _ in range(20 if k2 or k3 else 0):
                x = np.interp(np.arange(w.size) - lag / dt, np.arange(w.size), w, left=w0) / (1 + k2 * np.abs(x) + k3 * x * x)
            return x
        shift = lag / dt
        whole = int(shift)
        delayed = np.concatenate((np.full(whole + 2, w0), w))
        part = shift - whole
        d = (1 - part) * delayed[2 : 2 + w.size] + part * delayed[1 : 1 + w.size]
        if "softening" in e:
            k2, k3 = e["softening"]
            x0 = w0
            for _ in range(50):
                x0 = w0 / (1 + k2 * abs(x0) + k3 * x0 * x0)
            x = _spring(d, x0, dt, self.f1, self.zeta1, k2, k3)
        else:
            x = self._mode(d, w0, dt, self.f1, self.zeta1)
        x = (1 - self.share2) * x + self.share2 * self._mode(x, x[0], dt, self.f2, self.zeta2)
        if "extra_resonance" in e:
            f, zeta, r = e["extra_resonance"]
            x = x + r * (self._mode(x, x[0], dt, f, zeta) - x)
        return x

    @staticmethod
    def _mode(u, u0, dt, f, zeta):
        o = 2 * np.pi * f
        a, b, c, d, _ = cont2discrete(
            (np.array([[0, 1], [-o * o, -2 * zeta * o]]), np.array([[0], [o * o]]), np.array([[1.0, 0]]), np.zeros((1, 1))), dt
        )
        den = np.poly(a)
        num = np.poly(a - b @ c) - den
        return u0 + lfilter(num, den, u - u0)
