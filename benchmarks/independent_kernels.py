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

"""Recursions of the independent plant, each written the plain way and not the way of `effects`."""

import numpy as np

from piezo_hysteresis.blocks.kernel import kernel


@kernel
def bouc_wen(v, start, dt, A, beta, gamma, phi1, phi2, n, k, a, h):
    """h by the midpoint rule on a drive cut into steps of at most 2e-4; `k`, `a`: loop growing with speed."""
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


@kernel
def explicit_bouc_wen(v, start, A, beta, gamma, h):
    """h by one explicit step of Eq. (7) per sample, as simple simulators compute it."""
    out = np.empty(v.size)
    last = start
    for i in range(v.size):
        dv = v[i] - last
        last = v[i]
        h += A * dv - beta * abs(dv) * h - gamma * dv * abs(h)
        out[i] = h
    return out


@kernel
def plays(v, start, radii, weights):
    """Superposition of plays, centred where the drive starts."""
    out = np.zeros(v.size)
    state = np.full(radii.size, start)
    for i in range(v.size):
        for j in range(radii.size):
            state[j] = min(max(state[j], v[i] - radii[j]), v[i] + radii[j])
            out[i] += weights[j] * (state[j] - start)
    return out


@kernel
def slew(u, start, step):
    """Largest change per sample."""
    out = np.empty(u.size)
    y = start
    for i in range(u.size):
        y += min(max(u[i] - y, -step), step)
        out[i] = y
    return out


@kernel
def relax(w, start, dt, taus, weights):
    """Weighted first-order elements."""
    out = np.zeros(w.size)
    x = np.full(taus.size, start)
    keep = np.exp(-dt / taus)
    for i in range(w.size):
        for j in range(taus.size):
            x[j] = w[i] + (x[j] - w[i]) * keep[j]
            out[i] += weights[j] * x[j]
    return out


@kernel
def spring(w, x0, dt, f0, zeta, k2, k3):
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
