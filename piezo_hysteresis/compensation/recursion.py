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

"""The part of the inverse that is nonlinear in the last sample: creep, hysteresis, amplifier and limits in one loop.

Every state is computed from the limited drive. So the inverse continues from the real state of the stage after a limit
was reached.
"""

from __future__ import annotations

from math import sqrt

from ..blocks.kernel import inlined, kernel
from .hysteresis_solver import loop_end, plays_end, solve, static_part

PER_VOLT, LEFT, LEAD, BACK, PLAY, REACH, LOWER, UPPER, CORNER, LOWEST, HIGHEST, STEP, LOW, HIGH, TURN, RESOLUTION = (
    range(16)
)
"""Indices of the numbers of the drive: 1/voltage scale [1/V], pole, play, slew limit, saturation of the amplifier,
limits of the drive [V], limits of the search for v, sign of the static slope, least change that reverses a play [V]."""
DRIVE = (
    "per_volt", "left", "lead", "back", "play", "reach", "lower", "upper", "corner", "lowest", "highest", "step", "low",
    "high", "turn", "resolution",
)  # fmt: skip
"""Names of the same numbers, in `InverseTerms` and in C code."""
VOLTAGE, SLEWED, POLE, HELD, PUSHED, LAST, H, W = range(8)
"""Indices of the states: drive, voltages after slew limit, pole and play, and before the play [V]; v, h and w [1]."""
STATE = ("voltage", "slewed", "pole", "held", "pushed", "v", "h", "w")
"""Names of the same states, in `InverseStart` and in C code."""
SAME = 1e-13
"""A change below this share of the voltage does not count as a reversal of a play."""
TOUCHING = 1e-6
"""Largest distance from an edge of the play that counts as touching, as a share of its half width."""


@kernel
def saturated(u, lower, upper, corner):
    """Voltage after the saturation of the amplifier."""
    return u - ramp(u - upper, corner) + ramp(lower - u, corner)


@inlined
def ramp(excess, corner):
    """Ramp with a bend of half width `corner`."""
    if abs(excess) < corner:
        return (excess + corner) * (excess + corner) / (4.0 * corner)
    return max(excess, 0.0)


@inlined
def before_saturation(v, lower, upper, corner):
    """Inverse of `saturated`; for v beyond a limit, the voltage at which this limit is reached."""
    width, middle = upper - lower, 0.5 * (lower + upper)
    bent = corner if width >= 2.0 * corner else 0.25 * width * width / corner  # output range of one bend alone
    if v > upper - bent:
        return upper + corner - 2.0 * sqrt(corner * max(upper - v, 0.0))
    if v < lower + bent:
        return lower - corner + 2.0 * sqrt(corner * max(v - lower, 0.0))
    return v if bent == corner else middle + (v - middle) * (2.0 * corner / width)  # a line where the bends overlap


@inlined
def voltage_for(v, d, state):
    """Drive voltage [V], inside the limits, for a voltage v [V] after the play."""
    pushed = v
    if d[PLAY] > 0.0:
        move, same = v - state[HELD], SAME * (abs(v) + d[PLAY])
        side, touching = state[PUSHED] - state[HELD], d[PLAY] * (1.0 - TOUCHING)
        up = same if side >= touching else max(same, d[RESOLUTION])  # a reversal needs a jump to the other edge
        down = same if side <= -touching else max(same, d[RESOLUTION])
        pushed = v + d[PLAY] if move > up else v - d[PLAY] if move < -down else state[PUSHED]
    slewed = pushed
    if d[LEAD] != 1.0:
        slewed = (pushed - d[LEFT] * state[POLE] - d[BACK] * state[SLEWED]) / d[LEAD]
    slewed = min(max(slewed, state[SLEWED] - d[REACH]), state[SLEWED] + d[REACH])
    u = before_saturation(slewed, d[LOWER], d[UPPER], d[CORNER])
    u = min(max(u, state[VOLTAGE] - d[STEP]), state[VOLTAGE] + d[STEP])
    return min(max(u, d[LOWEST]), d[HIGHEST])


@inlined
def drive(u, d, state):
    """Voltage after the play [V] for the drive u [V]; the state is updated."""
    state[VOLTAGE] = u
    slewed = saturated(u, d[LOWER], d[UPPER], d[CORNER])
    slewed = min(max(slewed, state[SLEWED] - d[REACH]), state[SLEWED] + d[REACH])
    state[POLE] = d[LEFT] * state[POLE] + d[LEAD] * slewed + d[BACK] * state[SLEWED]
    state[SLEWED] = slewed
    state[PUSHED] = state[POLE]
    state[HELD] = max(state[POLE] - d[PLAY], min(state[POLE] + d[PLAY], state[HELD]))
    return state[HELD]


@inlined
def settle_before(target, starts, direct, fade, lead, weights, lasts, banks, gains, ahead):
    """w for which the relaxation banks give `target`; ahead (s,) is set to their states for an unchanged input."""
    for b in range(direct.size - 1, -1, -1):
        rest, last = 0.0, lasts[b]
        for j in range(starts[b], starts[b + 1]):
            ahead[j] = banks[j] + fade[j] * (last - banks[j])
            rest += weights[j] * (ahead[j] - lead[j] * last)
        target = (target - rest) / gains[b]
    return target


@inlined
def relax_to(w, starts, direct, lead, weights, lasts, banks, ahead):
    """Update the states of the banks for the next w."""
    for b in range(direct.size):
        moved, lasts[b] = w - lasts[b], w
        for j in range(starts[b], starts[b + 1]):
            banks[j] = ahead[j] + lead[j] * moved
        if b + 1 < direct.size:
            w += direct[b] * w
            for j in range(starts[b], starts[b + 1]):
                w += weights[j] * banks[j]


@kernel
def invert(targets, kind, p, periods, poly, c, radii, d, bank, state, plays, lasts, banks, u):
    """Drive u (n,) [V] for wanted outputs of the creep (n,) [1].

    `bank` is (starts, direct, fade, lead, weights, gains); state (8,), plays (s,), lasts and banks are updated. p,
    periods, poly and d are tuples: with arrays, the compiled code would count references at every inlined call, which
    takes as long as the search itself.
    """
    starts, direct, fade, lead, weights, gains = bank
    ahead = banks.copy()
    h, last, now = state[H], state[LAST], state[W]
    for i in range(targets.size):
        target = settle_before(targets[i], starts, direct, fade, lead, weights, lasts, banks, gains, ahead)
        v = solve(kind, p, periods, poly, c, radii, h, last, plays, target, now, d[TURN], d[LOW], d[HIGH])
        u[i] = voltage_for(v / d[PER_VOLT], d, state)
        v = drive(u[i], d, state) * d[PER_VOLT]
        h, last = loop_end(kind, p, periods, h, last, v), v
        now = static_part(poly, v) + h
        if radii.size:
            now += plays_end(c, radii, plays, v)
            for j in range(radii.size):
                plays[j] = max(v - radii[j], min(v + radii[j], plays[j]))
        relax_to(now, starts, direct, lead, weights, lasts, banks, ahead)
    state[H], state[LAST], state[W] = h, last, now


AMPLIFIER_IN_C = (
    f"""\
static const double SAME = {SAME!r}, TOUCHING = {TOUCHING!r};

"""
    """\
/* The voltage that is v after the saturation; for v beyond a limit, the voltage at which this limit is reached. */
static double before_saturation(double v, double lower, double upper, double corner)
{
    const double width = upper - lower, middle = 0.5 * (lower + upper);
    const double bent = width >= 2.0 * corner ? corner : 0.25 * width * width / corner;
    if (v > upper - bent) {
        return upper + corner - 2.0 * sqrt(corner * larger(upper - v, 0.0));
    }
    if (v < lower + bent) {
        return lower - corner + 2.0 * sqrt(corner * larger(v - lower, 0.0));
    }
    return bent < corner ? middle + (v - middle) * (2.0 * corner / width) : v;
}
"""
)
"""C function of `before_saturation`."""
REST_IN_C = """\
double w;
int j;
memset(s, 0, sizeof *s);
s->voltage = x;
s->slewed = s->pole = s->pushed = s->held = x - ramp(x - upper, corner) + ramp(lower - x, corner);
s->h = h0;
s->v = s->held * per_volt;
for (j = 0; j < PLAYS; j++) {
    s->play[j] = s->v - virgin * smaller(larger(s->v - earlier[j], -radius[j]), radius[j]);
}
{
    const hysteresis_before b = { loop, poly, c, root, radius, s->play, PLAYS, s->h, s->v };
    w = s->w = without_loop(&b, s->v) + s->h;
}
"""
"""C code of the state at rest, without the banks."""
DRIVE_IN_C = """\
const hysteresis_before b = { loop, poly, c, root, radius, s->play, PLAYS, s->h, s->v };
double v = solve(&b, x, s->w, turn, low, high) / per_volt, u, w, before;
int j;
/* the drive voltage, inside the limits, for a voltage v after the play */
u = v;
if (play > 0.0) {
    const double move = v - s->held, same = SAME * (fabs(v) + play), touching = play * (1.0 - TOUCHING);
    const double side = s->pushed - s->held;
    const double up = side >= touching ? same : larger(same, resolution);
    const double down = side <= -touching ? same : larger(same, resolution);
    u = move > up ? v + play : move < -down ? v - play : s->pushed;
}
if (lead != 1.0) {
    u = (u - left * s->pole - back * s->slewed) / lead;
}
u = smaller(larger(u, s->slewed - reach), s->slewed + reach);
u = before_saturation(u, lower, upper, corner);
u = smaller(larger(u, s->voltage - step), s->voltage + step);
u = smaller(larger(u, lowest), highest);
/* the states for the limited drive */
s->voltage = u;
before = s->slewed;
s->slewed = u - ramp(u - upper, corner) + ramp(lower - u, corner);
s->slewed = smaller(larger(s->slewed, before - reach), before + reach);
s->pole = left * s->pole + lead * s->slewed + back * before;
s->pushed = s->pole;
s->held = larger(s->pole - play, smaller(s->pole + play, s->held));
v = s->held * per_volt;
w = without_loop(&b, v);
s->h = loop_end(&b, v);
s->v = v;
for (j = 0; j < PLAYS; j++) {
    s->play[j] = larger(v - radius[j], smaller(v + radius[j], s->play[j]));
}
w = s->w = w + s->h;
"""
"""C code of one sample, between `settle_before` and `relax_to`."""
BEFORE_IN_C = """\
double ahead_BANK[SIZE_BANK], rest_BANK = 0.0;
for (int i = 0; i < SIZE_BANK; i++) {
    ahead_BANK[i] = s->bank_BANK[i] + fade_BANK[i] * (s->last_BANK - s->bank_BANK[i]);
    rest_BANK += weight_BANK[i] * (ahead_BANK[i] - lead_BANK[i] * s->last_BANK);
}
x = (x - rest_BANK) / gain_BANK;
"""
"""C code of `settle_before` for one bank."""
AFTER_IN_C = """\
for (int i = 0; i < SIZE_BANK; i++) {
    s->bank_BANK[i] = ahead_BANK[i] + lead_BANK[i] * (w - s->last_BANK);
}
s->last_BANK = w;
w += direct_BANK * w;
for (int i = 0; i < SIZE_BANK; i++) {
    w += weight_BANK[i] * s->bank_BANK[i];
}
"""
"""C code of `relax_to` for one bank."""
SETTLED_IN_C = """\
s->last_BANK = w;
for (int i = 0; i < SIZE_BANK; i++) {
    s->bank_BANK[i] = w;
}
w += settled_BANK * w;
"""
"""C code of one bank at rest."""
