"""Kernels of the Bouc-Wen loop, stepped exactly over a drive that is linear between samples.

Along the path length ℓ = |Δv| with s = sgn Δv and g = sgn h the loop with all its terms obeys

    dh/dℓ = s·A_eff − r·h,    r = |h/h_ref|^(n−1)·(β + γ s g) − φ1 s − φ2 g

which for n = 1 has the closed solution h(ℓ) = h0 + (s·A_eff − r·h0)·(1 − e^(−rℓ))/r; where h crosses zero, g and with
it r flip. For n ≠ 1 the power is frozen at the middle of sub-steps of at most `SUB_STEP`. Loop parameters are an array
in the order of `LOOP`; a term at its off value leaves every bit of the plain loop as it is.
"""

from __future__ import annotations

from math import ceil, copysign, exp, expm1, log, log1p

import numpy as np
from numpy.typing import NDArray

from ..kernel import kernel

Array = NDArray[np.float64]

LOOP = ("A", "beta", "gamma", "phi1", "phi2", "n", "k", "a")
A, BETA, GAMMA, PHI1, PHI2, EXPONENT, RATE, RATE_EXPONENT = range(8)
H_REFERENCE = 0.2
SUB_STEP = 0.01
SLOWEST = 1e-4
"""Rates below this (normalised units per second) count as this, so that the rate law stays finite."""


@kernel
def decay(r, length):
    """(1 − e^(−r·length))/r, also for small r."""
    x = r * length
    if abs(x) < 0.02:
        return length * (1.0 - x * (0.5 - x * (1.0 / 6.0 - x * (1.0 / 24.0 - x * (1.0 / 120.0 - x / 720.0)))))
    return -expm1(-x) / r


@kernel
def decay_slope(r, length):
    """∂decay/∂r."""
    x = r * length
    if abs(x) < 0.02:
        return -length * length * (0.5 - x * (1.0 / 3.0 - x * (1.0 / 8.0 - x * (1.0 / 30.0 - x / 144.0))))
    return (length * exp(-x) - decay(r, length)) / r


@kernel
def crossing(h, drive, r):
    """Path length at which h, driven towards zero, gets there; infinite where it never does."""
    x = h * r / drive
    if x >= 1.0:
        return np.inf
    return -h / drive if abs(r) < 1e-12 else log1p(-x) / r


@kernel
def rate_factor(speed, a):
    """((|v̇|/v0)^a − 1)/a with v0 = 1 per second; the logarithm for a → 0."""
    x = log(max(speed, SLOWEST))
    return x if abs(a) < 1e-9 else expm1(a * x) / a


@kernel
def advance(h, drive, length, r_same, r_flipped):
    """h after `length` from h with loss rate r_same, and r_flipped once h has crossed zero."""
    if h * drive < 0.0:
        reach = crossing(h, drive, r_same)
        if reach < length:
            return drive * decay(r_flipped, length - reach)
    return h + (drive - r_same * h) * decay(r_same, length)


@kernel
def run_plain(v, p, state, h_out):
    """The n = 1 loop without terms. state = [h, v_last], updated; h_out (n,) is filled."""
    a, beta, gamma = p[A], p[BETA], p[GAMMA]
    h, last = state[0], state[1]
    for i in range(v.size):
        dv = v[i] - last
        if dv != 0.0:
            s = copysign(1.0, dv)
            g = s * a if h == 0.0 else h
            g = copysign(1.0, g)
            h = advance(h, s * a, abs(dv), beta + gamma * s * g, beta - gamma * s * g)
            last = v[i]
        h_out[i] = h
    state[0], state[1] = h, last


@kernel
def run_general(v, p, sample_period, state, h_out):
    """The loop with all its terms; arguments as `run_plain`."""
    n, k = p[EXPONENT], p[RATE]
    h, last = state[0], state[1]
    for i in range(v.size):
        dv = v[i] - last
        if dv != 0.0:
            s = copysign(1.0, dv)
            drive = s * p[A]
            if k != 0.0:
                drive = drive * (1.0 + k * rate_factor(abs(dv) / sample_period, p[RATE_EXPONENT]))
            steps = 1
            if n != 1.0:
                steps = max(1, int(ceil(abs(dv) / SUB_STEP)))
            length = abs(dv) / steps
            for _ in range(steps):
                g = copysign(1.0, drive if h == 0.0 else h)
                bend = p[PHI1] * s
                same, flipped = p[BETA] + p[GAMMA] * s * g, p[BETA] - p[GAMMA] * s * g
                if n != 1.0:
                    power = abs(h / H_REFERENCE) ** (n - 1.0)
                    gm = p[PHI2] * g
                    middle = advance(h, drive, 0.5 * length, power * same - bend - gm, power * flipped - bend + gm)
                    power = abs(middle / H_REFERENCE) ** (n - 1.0)
                    same, flipped = power * same, power * flipped
                h = advance(h, drive, length, same - bend - p[PHI2] * g, flipped - bend + p[PHI2] * g)
            last = v[i]
        h_out[i] = h
    state[0], state[1] = h, last


@kernel
def advance_slopes(h, drive, length, r_same, r_flipped, out):
    """`advance`, with out = its derivatives by h, drive, length, r_same, r_flipped."""
    out[3] = 0.0
    out[4] = 0.0
    if h * drive < 0.0:
        reach = crossing(h, drive, r_same)
        if reach < length:
            rest = length - reach
            left = exp(-r_flipped * rest)
            pull = drive - h * r_same
            out[0] = drive * left / pull
            out[1] = decay(r_flipped, rest) - left * h / pull
            out[2] = drive * left
            if abs(r_same) < 1e-6:
                out[3] = 0.5 * left * h * h / drive
            else:
                out[3] = drive * left * (reach + h / pull) / r_same
            out[4] = drive * decay_slope(r_flipped, rest)
            return drive * decay(r_flipped, rest)
    phi = decay(r_same, length)
    left = 1.0 - r_same * phi
    out[0] = left
    out[1] = phi
    out[2] = (drive - r_same * h) * left
    out[3] = -h * phi + (drive - r_same * h) * decay_slope(r_same, length)
    return h + (drive - r_same * h) * phi


@kernel
def slope_at(h, p, s):
    """∂h/∂v at the beginning of a motion in direction s."""
    g = copysign(1.0, s if h == 0.0 else h)
    loss = p[BETA] + p[GAMMA] * s * g
    if p[EXPONENT] != 1.0:
        loss *= abs(h / H_REFERENCE) ** (p[EXPONENT] - 1.0)
    drive = p[A]
    if p[RATE] != 0.0:
        drive *= 1.0 + p[RATE] * rate_factor(0.0, p[RATE_EXPONENT])
    return drive - s * (loss - p[PHI1] * s - p[PHI2] * g) * h


@kernel
def linearise_general(v, dv_in, p, own, sample_period, state, tangent, last_in, h_out, dh_out):
    """`run_general` with sensitivities.

    dv_in (m, n) are incoming rows; own (q,) the indices into `LOOP` of the wanted own rows; tangent (m + q,) holds ∂h,
    last_in (m,) the incoming slopes of v_last; dh_out (m + q, n) is filled. While v is held, a row that moves counts as
    a motion in its own direction: the slope for a growing parameter.
    """
    m, q = dv_in.shape[0], own.size
    n, k = p[EXPONENT], p[RATE]
    h, last = state[0], state[1]
    drive_by = np.zeros(8)
    same_by = np.zeros(8)
    flipped_by = np.zeros(8)
    half = np.zeros(5)
    full = np.zeros(5)
    rated, powered = k != 0.0, n != 1.0
    for c in own:
        rated = rated or c == RATE
        powered = powered or c == EXPONENT
    for i in range(v.size):
        dv = v[i] - last
        if dv != 0.0:
            s = copysign(1.0, dv)
            drive = s * p[A]
            drive_by[:] = 0.0
            drive_by[A] = s
            drive_by_speed = 0.0
            if rated:
                speed = abs(dv) / sample_period
                factor = rate_factor(speed, p[RATE_EXPONENT])
                drive_by[RATE] = drive * factor
                if k != 0.0:
                    x = log(max(speed, SLOWEST))
                    e = p[RATE_EXPONENT]
                    factor_by_a = 0.5 * x * x if abs(e) < 1e-6 else (x * exp(e * x) - factor) / e
                    drive_by[RATE_EXPONENT] = drive * k * factor_by_a
                    if speed > SLOWEST:
                        drive_by_speed = drive * k * exp((e - 1.0) * x)
                    drive_by[A] = s * (1.0 + k * factor)
                    drive = drive * (1.0 + k * factor)
            steps = 1
            whole_step = h
            if powered:
                steps = max(1, int(ceil(abs(dv) / SUB_STEP)))
                g = copysign(1.0, drive if h == 0.0 else h)
                bend, gm, turn = p[PHI1] * s, p[PHI2] * g, p[GAMMA] * s * g
                whole_step = advance(h, drive, abs(dv), p[BETA] + turn - bend - gm, p[BETA] - turn - bend + gm)
            length = abs(dv) / steps
            for _ in range(steps):
                g = copysign(1.0, drive if h == 0.0 else h)
                loss, loss_flipped = p[BETA] + p[GAMMA] * s * g, p[BETA] - p[GAMMA] * s * g
                offset, offset_flipped = -p[PHI1] * s - p[PHI2] * g, -p[PHI1] * s + p[PHI2] * g
                power, power_by_h, power_by_n = 1.0, 0.0, 0.0
                first, first_by_h, first_by_n = 1.0, 0.0, 0.0
                if powered:
                    if n != 1.0:
                        first = abs(h / H_REFERENCE) ** (n - 1.0)
                    middle = advance_slopes(
                        h, drive, 0.5 * length, first * loss + offset, first * loss_flipped + offset_flipped, half
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
                h_next = advance_slopes(
                    h, drive, length, power * loss + offset, power * loss_flipped + offset_flipped, full
                )
                by_power = full[3] * loss + full[4] * loss_flipped
                for j in range(m + q):
                    d_drive, d_same, d_flipped, d_length, d_n = 0.0, 0.0, 0.0, 0.0, 0.0
                    c = -1
                    if j < m:
                        d_length = s * (dv_in[j, i] - last_in[j])
                        d_drive = drive_by_speed * d_length / sample_period
                        d_length /= steps
                    else:
                        c = own[j - m]
                        d_drive, d_same, d_flipped = drive_by[c], same_by[c], flipped_by[c]
                        if c == EXPONENT:
                            d_n = 1.0
                    dh = tangent[j]
                    d_power = power_by_n * d_n
                    if n != 1.0:
                        d_first = first_by_h * dh + first_by_n * d_n
                        d_middle = half[0] * dh + half[1] * d_drive + 0.5 * half[2] * d_length
                        d_middle += half[3] * loss * d_first + half[4] * loss_flipped * d_first
                        if j >= m and c != EXPONENT:
                            scale = first / power if (c == BETA or c == GAMMA) and power != 0.0 else 1.0
                            d_middle += (half[3] * d_same + half[4] * d_flipped) * scale
                        d_power += power_by_h * d_middle
                    tangent[j] = (
                        full[0] * dh
                        + full[1] * d_drive
                        + full[2] * d_length
                        + full[3] * d_same
                        + full[4] * d_flipped
                        + by_power * d_power
                    )
                h = h_next
            if powered and n == 1.0:
                h = whole_step
            last = v[i]
        else:
            for j in range(m):
                move = dv_in[j, i] - last_in[j]
                if move != 0.0:
                    tangent[j] += slope_at(h, p, copysign(1.0, move)) * move
        for j in range(m):
            last_in[j] = dv_in[j, i]
        h_out[i] = h
        for j in range(m + q):
            dh_out[j, i] = tangent[j]
    state[0], state[1] = h, last
