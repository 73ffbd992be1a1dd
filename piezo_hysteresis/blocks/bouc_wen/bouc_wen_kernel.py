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

"""Kernels of the Bouc-Wen loop, stepped exactly over a drive that is linear between samples.

Along the path length ℓ = |Δv| with s = sgn Δv and g = sgn h the loop with all its terms obeys

    dh/dℓ = s·A_eff − r·h,    r = |h/h_ref|^(n−1)·(β + γ s g) − φ1 s − φ2 g

which for n = 1 has the closed solution h(ℓ) = h0 + (s·A_eff − r·h0)·(1 − e^(−rℓ))/r. When h crosses zero, g changes its
sign, and r changes. For n ≠ 1 the power is evaluated at the middle of sub-steps of at most `SUB_STEP`. Loop parameters
are an array in the order of `LOOP`. With all terms at their off values the result is bit-identical to the plain loop.
The output is w = p1 v³ + p2 v + h.
"""

from __future__ import annotations

from math import ceil, copysign, expm1, log, log1p

import numpy as np

from ..kernel import inlined, kernel

LOOP = ("A", "beta", "gamma", "phi1", "phi2", "n", "k", "a")
"""Names of the loop parameters, in the order of their array."""
LOOP_OFF = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.5])
"""Loop parameters with every term at its off value."""
A, BETA, GAMMA, PHI1, PHI2, EXPONENT, RATE, RATE_EXPONENT = range(8)
"""Indices in the array of loop parameters."""
H_REFERENCE = 0.2
"""State h_ref at which β and γ have the same meaning for every exponent n [1]."""
SUB_STEP = 0.01
"""Longest step of v for n ≠ 1 [1]."""
SUB_STEP_ROUNDING = 1e-9
"""Part of a sub-step by which a step may exceed a whole number of them: a slew limit makes steps of just that length,
and their rounding must not decide."""
JUMP = 0.05
"""Change of v in one sample of a slow record from which it is a jump, which takes one sample period of the model."""
SLOWEST = 1e-4
"""Lowest rate (normalised units per second); smaller rates are set to it, so that the rate law stays finite."""


@kernel
def decay(r, length):
    """(1 − e^(−r·length))/r, also for small r."""
    x = r * length
    if abs(x) < 0.02:
        return length * (1.0 - x * (0.5 - x * (1.0 / 6.0 - x * (1.0 / 24.0 - x * (1.0 / 120.0 - x * (1.0 / 720.0))))))
    return -expm1(-x) / r


@kernel
def crossing(h, drive, r):
    """Path length after which h reaches zero."""
    return -h / drive if abs(r) < 1e-12 else log1p(-h * r / drive) / r


@kernel
def rate_factor(speed, a):
    """((|v̇|/v0)^a − 1)/a with v0 = 1 per second; the logarithm for a → 0."""
    x = log(max(speed, SLOWEST))
    return x if abs(a) < 1e-9 else expm1(a * x) / a


@kernel
def advance(h, drive, length, r_same, r_flipped):
    """h after the path `length`, with loss rate r_same, and r_flipped after h has crossed zero."""
    end = h + (drive - r_same * h) * decay(r_same, length)
    if end * h < 0.0:
        end = drive * decay(r_flipped, max(0.0, length - crossing(h, drive, r_same)))
    return end


@inlined
def plain_step(h, dv, a, beta, gamma):
    """h of the n = 1 loop without terms after a step dv ≠ 0.

    Both loss rates are computed before h is known, so only few operations depend on the last h.
    """
    s, length = copysign(1.0, dv), abs(dv)
    drive = s * a
    r_above, r_below = beta + gamma * s, beta - gamma * s
    above, below = decay(r_above, length), decay(r_below, length)
    is_above = h > 0.0 or (h == 0.0 and drive > 0.0)
    r_same = r_above if is_above else r_below
    end = h + (drive - r_same * h) * (above if is_above else below)
    if end * h < 0.0:
        r_flipped = r_below if is_above else r_above
        end = drive * decay(r_flipped, max(0.0, length - crossing(h, drive, r_same)))
    return end


@inlined
def sub_steps(length):
    """Number of sub-steps of a step of `length` where n ≠ 1."""
    return max(1, int(ceil(length / SUB_STEP - SUB_STEP_ROUNDING)))


@inlined
def step_at_speed(h, dv, p, speed):
    """h of the loop with all terms after a step dv ≠ 0, for a speed |v̇| of the rate law."""
    n, k = p[EXPONENT], p[RATE]
    s = copysign(1.0, dv)
    drive = s * p[A]
    if k != 0.0:
        drive = drive * (1.0 + k * rate_factor(speed, p[RATE_EXPONENT]))
    steps = 1
    if n != 1.0:
        steps = sub_steps(abs(dv))
    length = abs(dv) / steps
    for _ in range(steps):
        g = copysign(1.0, drive if h == 0.0 else h)
        bend, gm = p[PHI1] * s, p[PHI2] * g
        same, flipped = p[BETA] + p[GAMMA] * s * g, p[BETA] - p[GAMMA] * s * g
        if n != 1.0:
            power = abs(h / H_REFERENCE) ** (n - 1.0)
            middle = advance(h, drive, 0.5 * length, power * same - bend - gm, power * flipped - bend + gm)
            power = abs(middle / H_REFERENCE) ** (n - 1.0)
            same, flipped = power * same, power * flipped
        h = advance(h, drive, length, same - bend - gm, flipped - bend + gm)
    return h


@inlined
def general_step(h, dv, p, sample_period, jump_period):
    """h of the loop with all terms after a step dv ≠ 0. A jump takes `jump_period`, other steps `sample_period`."""
    return step_at_speed(h, dv, p, abs(dv) / (jump_period if abs(dv) > JUMP else sample_period))


@kernel
def run_plain(v, p, p1, p2, state, w):
    """The n = 1 loop without terms. state = [h, v_last], updated; w (n,) is filled."""
    a, beta, gamma = p[A], p[BETA], p[GAMMA]
    h, last = state[0], state[1]
    for i in range(v.size):
        x = v[i]
        dv = x - last
        if dv != 0.0:
            last = x
            h = plain_step(h, dv, a, beta, gamma)
        w[i] = p1 * x * x * x + p2 * x + h
    state[0], state[1] = h, last


@kernel
def run_general(v, p, p1, p2, sample_period, jump_period, state, w):
    """The loop with all terms; arguments as `run_plain`. A jump takes `jump_period`, other steps `sample_period`."""
    h, last = state[0], state[1]
    for i in range(v.size):
        x = v[i]
        dv = x - last
        if dv != 0.0:
            last = x
            h = general_step(h, dv, p, sample_period, jump_period)
        w[i] = p1 * x * x * x + p2 * x + h
    state[0], state[1] = h, last


ADVANCE_IN_C = """\
/* (1 - exp(-r length))/r, also for small r. */
static double decay(double r, double length)
{
    const double x = r * length;
    if (fabs(x) < 0.02) {
        return length
            * (1.0 - x * (0.5 - x * (1.0 / 6.0 - x * (1.0 / 24.0 - x * (1.0 / 120.0 - x * (1.0 / 720.0))))));
    }
    return -expm1(-x) / r;
}

/* Path length at which h, driven through zero, gets there. */
static double crossing(double h, double drive, double r)
{
    return fabs(r) < 1e-12 ? -h / drive : log1p(-h * r / drive) / r;
}
"""
"""C functions of `decay` and `crossing`."""
PLAIN_IN_C = """\
/* h of the Bouc-Wen loop after a straight way of dv, which is not zero. */
static double plain_step(double h, double dv, double a, double beta, double gamma)
{
    const double s = copysign(1.0, dv), length = fabs(dv), drive = s * a;
    const double r_above = beta + gamma * s, r_below = beta - gamma * s;
    const int is_above = h > 0.0 || (h == 0.0 && drive > 0.0);
    const double r_same = is_above ? r_above : r_below, r_flipped = is_above ? r_below : r_above;
    const double end = h + (drive - r_same * h) * decay(r_same, length);
    if (end * h < 0.0) {
        return drive * decay(r_flipped, larger(0.0, length - crossing(h, drive, r_same)));
    }
    return end;
}
"""
"""C function of `plain_step`."""
STEP_AT_SPEED_IN_C = (
    f"""\
static const double JUMP = {JUMP!r}, SLOWEST = {SLOWEST!r}, SUB_STEP = {SUB_STEP!r};
static const double SUB_STEP_ROUNDING = {SUB_STEP_ROUNDING!r}, H_REFERENCE = {H_REFERENCE!r};

"""
    """\
/* h after `length` with loss rate r_same, and r_flipped once h has crossed zero. */
static double advance(double h, double drive, double length, double r_same, double r_flipped)
{
    const double end = h + (drive - r_same * h) * decay(r_same, length);
    if (end * h < 0.0) {
        return drive * decay(r_flipped, larger(0.0, length - crossing(h, drive, r_same)));
    }
    return end;
}

/* h of the Bouc-Wen loop with all its terms after a straight way of dv, which is not zero, at a speed;
   p = A, beta, gamma, phi1, phi2, n, k, a. */
static double step_at_speed(double h, double dv, const double *p, double speed)
{
    const double n = p[5], k = p[6], s = copysign(1.0, dv);
    double drive = s * p[0], length = fabs(dv);
    int steps = 1, i;
    if (k != 0.0) {
        const double rate = log(larger(speed, SLOWEST));
        drive = drive * (1.0 + k * (fabs(p[7]) < 1e-9 ? rate : expm1(p[7] * rate) / p[7]));
    }
    if (n != 1.0) {
        steps = (int)larger(1.0, ceil(length / SUB_STEP - SUB_STEP_ROUNDING));
    }
    length = length / steps;
    for (i = 0; i < steps; i++) {
        const double g = copysign(1.0, h == 0.0 ? drive : h), bend = p[3] * s, gm = p[4] * g;
        double same = p[1] + p[2] * s * g, flipped = p[1] - p[2] * s * g;
        if (n != 1.0) {
            double power = pow(fabs(h / H_REFERENCE), n - 1.0);
            const double middle
                = advance(h, drive, 0.5 * length, power * same - bend - gm, power * flipped - bend + gm);
            power = pow(fabs(middle / H_REFERENCE), n - 1.0);
            same = power * same;
            flipped = power * flipped;
        }
        h = advance(h, drive, length, same - bend - gm, flipped - bend + gm);
    }
    return h;
}
"""
)
"""C function of `step_at_speed`."""
GENERAL_IN_C = """\
/* The step at the speed of a jump, or of another change within a sample. */
static double general_step(double h, double dv, const double *p, double sample_period, double jump_period)
{
    return step_at_speed(h, dv, p, fabs(dv) / (fabs(dv) > JUMP ? jump_period : sample_period));
}
"""
"""C function of `general_step`."""
