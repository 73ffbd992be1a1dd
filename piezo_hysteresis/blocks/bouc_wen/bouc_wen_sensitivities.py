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

"""Sensitivities of the Bouc-Wen loop: derivatives of the kernels in `bouc_wen_kernel`."""

from __future__ import annotations

from math import copysign, exp, log

import numpy as np

from ..kernel import inlined, kernel
from .bouc_wen_kernel import (
    BETA,
    EXPONENT,
    GAMMA,
    H_REFERENCE,
    JUMP,
    LOOP,
    PHI1,
    PHI2,
    RATE,
    RATE_EXPONENT,
    SLOWEST,
    A,
    advance,
    crossing,
    decay,
    rate_factor,
    sub_steps,
)
from .speed_lag import FADE, LEFT, SHARE, lagged_slopes

OWN = (*LOOP, "h0", "tau")
"""Numbers of the loop and its terms, in the order of their indices in the own rows."""
START, LAG = OWN.index("h0"), OWN.index("tau")
"""Indices of the initial state, which has no forcing term, and of the lag of the speed."""


@kernel
def decay_slope(r, length):
    """∂decay/∂r."""
    x = r * length
    if abs(x) < 0.02:
        return -length * length * (0.5 - x * (1.0 / 3.0 - x * (1.0 / 8.0 - x * (1.0 / 30.0 - x * (1.0 / 144.0)))))
    return (length * exp(-x) - decay(r, length)) / r


@inlined
def advance_slopes(h, drive, length, r_same, r_flipped):
    """`advance`, and its derivatives by h, drive, length, r_same, r_flipped."""
    phi = decay(r_same, length)
    pull = drive - h * r_same
    end = h + pull * phi
    if end * h < 0.0:
        reach = crossing(h, drive, r_same)
        rest = max(0.0, length - reach)
        left, drift = exp(-r_flipped * rest), decay(r_flipped, rest)
        by_same = 0.5 * left * h * h / drive if abs(r_same) < 1e-6 else drive * left * (reach + h / pull) / r_same
        by_flipped = drive * decay_slope(r_flipped, rest)
        return drive * drift, (drive * left / pull, drift - left * h / pull, drive * left, by_same, by_flipped)
    left = 1.0 - r_same * phi
    by_same = -h * phi + pull * decay_slope(r_same, length)
    return end, (left, phi, pull * left, by_same, 0.0)


@kernel
def slope_at(h, p, s, speed):
    """∂h/∂v at the beginning of a motion in direction s, at a speed of the rate law."""
    g = copysign(1.0, s if h == 0.0 else h)
    loss = p[BETA] + p[GAMMA] * s * g
    if p[EXPONENT] != 1.0:
        loss *= abs(h / H_REFERENCE) ** (p[EXPONENT] - 1.0)
    drive = p[A]
    if p[RATE] != 0.0:
        drive *= 1.0 + p[RATE] * rate_factor(speed, p[RATE_EXPONENT])
    return drive - s * (loss - p[PHI1] * s - p[PHI2] * g) * h


@kernel
def linearise_plain(v, p, p1, p2, state, tangent, w, dw):
    """`linearise_general` for n = 1 without terms and without incoming rows: rows A, β, γ, p1, p2."""
    a, beta, gamma = p[A], p[BETA], p[GAMMA]
    h, last = state[0], state[1]
    by_a, by_beta, by_gamma = tangent[0], tangent[1], tangent[2]
    row_a, row_beta, row_gamma, row_1, row_2 = dw[0], dw[1], dw[2], dw[3], dw[4]
    for i in range(v.size):
        x = v[i]
        dv = x - last
        if dv != 0.0:
            last = x
            s = copysign(1.0, dv)
            drive = s * a
            turn = s * copysign(1.0, drive if h == 0.0 else h)
            h, full = advance_slopes(h, drive, abs(dv), beta + gamma * turn, beta - gamma * turn)
            by_a = full[0] * by_a + full[1] * s
            by_beta = full[0] * by_beta + (full[3] + full[4])
            by_gamma = full[0] * by_gamma + (full[3] * turn - full[4] * turn)
        row_a[i], row_beta[i], row_gamma[i] = by_a, by_beta, by_gamma
        w[i] = p1 * x * x * x + p2 * x + h
    for i in range(v.size):
        row_1[i], row_2[i] = v[i] * v[i] * v[i], v[i]
    state[0], state[1] = h, last
    tangent[0], tangent[1], tangent[2] = by_a, by_beta, by_gamma


@kernel
def linearise_general(v, dv_in, p, p1, p2, own, periods, lag, state, tangent, last_in, lagged_by, w, dw):
    """`run_general` or `run_lagged` with sensitivities.

    dv_in (m, n) are incoming rows; own (q,) are the indices of the own rows in `OWN`; `periods` are those of a step and
    of a jump; tangent (m + q,) is ∂h, last_in (m,) are the incoming sensitivities of v_last, and lagged_by (m + 1,)
    those of the lagged speed, by the incoming rows and by τ; dw (m + q + 2, n) is filled, with p1 and p2 last. While v
    is constant, a changing row counts as motion in its direction: the derivative for a growing parameter.
    """
    m, q = dv_in.shape[0], own.size
    n, k = p[EXPONENT], p[RATE]
    h, last, lagged, speed = state[0], state[1], state[2], 0.0
    speed_by = np.zeros(m + 1)
    drive_by = np.zeros(LAG + 1)
    same_by = np.zeros(LAG + 1)
    flipped_by = np.zeros(LAG + 1)
    half = (0.0, 0.0, 0.0, 0.0, 0.0)
    rated, powered = k != 0.0, n != 1.0
    for c in own:
        rated = rated or c == RATE
        powered = powered or c == EXPONENT
    for i in range(v.size):
        x = v[i]
        dv = x - last
        if rated:
            jumps = 1 if abs(dv) > JUMP else 0
            now = abs(dv) / periods[jumps]
            behind = lagged - now
            for j in range(m + 1):
                move = (dv_in[j, i] - last_in[j]) / periods[jumps] if j < m else 0.0
                now_by = copysign(1.0, dv) * move if dv != 0.0 else abs(move)
                of_tau = 1.0 if j == m else 0.0
                speed_by[j], lagged_by[j] = lagged_slopes(
                    lag[jumps], behind, now, lagged_by[j] - now_by, now_by, of_tau
                )
            speed = now + lag[jumps, SHARE] * behind
            lagged = lag[jumps, LEFT] * (now + lag[jumps, FADE] * behind)
        if dv != 0.0:
            last = x
            s = copysign(1.0, dv)
            drive = s * p[A]
            drive_by[A] = s
            drive_by_speed = 0.0
            if rated:
                factor = rate_factor(speed, p[RATE_EXPONENT])
                drive_by[RATE] = drive * factor
                if k != 0.0:
                    e, ln = p[RATE_EXPONENT], log(max(speed, SLOWEST))
                    factor_by_a = 0.5 * ln * ln if abs(e) < 1e-6 else (ln * exp(e * ln) - factor) / e
                    drive_by[RATE_EXPONENT] = drive * k * factor_by_a
                    if speed > SLOWEST:
                        drive_by_speed = drive * k * exp((e - 1.0) * ln)
                    drive_by[LAG] = drive_by_speed * speed_by[m]
                    drive_by[A] = s * (1.0 + k * factor)
                    drive = drive * (1.0 + k * factor)
            steps = 1
            whole_step = h
            if powered:
                steps = sub_steps(abs(dv))
                g = copysign(1.0, drive if h == 0.0 else h)
                bend, gm, turn = p[PHI1] * s, p[PHI2] * g, p[GAMMA] * s * g
                whole_step = advance(h, drive, abs(dv), p[BETA] + turn - bend - gm, p[BETA] - turn - bend + gm)
            length = abs(dv) / steps
            for _ in range(steps):
                g = copysign(1.0, drive if h == 0.0 else h)
                bend, gm = p[PHI1] * s, p[PHI2] * g
                loss, loss_flipped = p[BETA] + p[GAMMA] * s * g, p[BETA] - p[GAMMA] * s * g
                power, power_by_h, power_by_n = 1.0, 0.0, 0.0
                first, first_by_h, first_by_n = 1.0, 0.0, 0.0
                if n != 1.0:
                    first = abs(h / H_REFERENCE) ** (n - 1.0)
                if powered:
                    middle, half = advance_slopes(
                        h, drive, 0.5 * length, first * loss - bend - gm, first * loss_flipped - bend + gm
                    )
                    if n != 1.0:
                        power = abs(middle / H_REFERENCE) ** (n - 1.0)
                    if h != 0.0:
                        first_by_h = (n - 1.0) * first / h
                        first_by_n = first * log(abs(h / H_REFERENCE))
                    if middle != 0.0:
                        power_by_h = (n - 1.0) * power / middle
                        power_by_n = power * log(abs(middle / H_REFERENCE))
                same_by[BETA], same_by[GAMMA], same_by[PHI1], same_by[PHI2] = power, power * s * g, -s, -g
                flipped_by[BETA], flipped_by[GAMMA], flipped_by[PHI1], flipped_by[PHI2] = power, -power * s * g, -s, g
                h_next, full = advance_slopes(
                    h, drive, length, power * loss - bend - gm, power * loss_flipped - bend + gm
                )
                for j in range(m):
                    move, faster = s * (dv_in[j, i] - last_in[j]) / steps, drive_by_speed * speed_by[j]
                    fresh = full[1] * faster + full[2] * move
                    if n != 1.0:
                        middle_by = half[0] * tangent[j] + half[1] * faster + 0.5 * half[2] * move
                        middle_by += (half[3] * loss + half[4] * loss_flipped) * first_by_h * tangent[j]
                        fresh += (full[3] * loss + full[4] * loss_flipped) * power_by_h * middle_by
                    tangent[j] = full[0] * tangent[j] + fresh
                for j in range(q):
                    c = own[j]
                    dh = tangent[m + j]
                    fresh = full[1] * drive_by[c] + full[3] * same_by[c] + full[4] * flipped_by[c]
                    if powered:
                        d_n = 1.0 if c == EXPONENT else 0.0
                        d_power = power_by_n * d_n
                        if n != 1.0:
                            scale = first / power if (c == BETA or c == GAMMA) and power != 0.0 else 1.0
                            middle_by = half[0] * dh + half[1] * drive_by[c]
                            middle_by += (half[3] * same_by[c] + half[4] * flipped_by[c]) * scale
                            d_first = first_by_h * dh + first_by_n * d_n
                            middle_by += (half[3] * loss + half[4] * loss_flipped) * d_first
                            d_power += power_by_h * middle_by
                        fresh += (full[3] * loss + full[4] * loss_flipped) * d_power
                    tangent[m + j] = full[0] * dh + fresh
                h = h_next
            if powered and n == 1.0:
                h = whole_step
        else:
            for j in range(m):
                move = dv_in[j, i] - last_in[j]
                if move != 0.0:
                    tangent[j] += slope_at(h, p, copysign(1.0, move), speed) * move
        by_v = 3.0 * p1 * x * x + p2
        for j in range(m):
            last_in[j] = dv_in[j, i]
            dw[j, i] = tangent[j] + by_v * dv_in[j, i]
        for j in range(m, m + q):
            dw[j, i] = tangent[j]
        dw[m + q, i] = x * x * x
        dw[m + q + 1, i] = x
        w[i] = p1 * x * x * x + p2 * x + h
    state[0], state[1], state[2] = h, last, lagged
