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

"""Kernels that compute the normalised drive v at which the hysteresis output w has a wanted value.

w(v) = p1 v³ + p2 v + p_e v² + p_4 v⁴ + h(v) + Σ_j c_j f_j(p_j) with the plays p_j(v) and f_j of `level_density`; c, a,
b and q are the rows of one array, c alone if f_j(p) = p. h is computed by the kernels of the model, so the root agrees
with it up to rounding.
If ∂h/∂v is known in closed form, Newton's method is used. Otherwise, or if Newton's method leaves the range or does not
converge, one Newton step is followed by the secant method inside a bracket.
"""

from __future__ import annotations

from math import copysign

from ..blocks.bouc_wen.bouc_wen_kernel import BETA, GAMMA, A, general_step, plain_step
from ..blocks.kernel import fma, inlined
from ..effects.hysteresis.level_density import level_density, level_value
from ..effects.hysteresis.published_bouc_wen import step as published_step
from ..inverse_terms import GENERAL, NO_LOOP, PLAIN

P1, P2, SQUARE, FOURTH = range(4)
"""Coefficients of the static polynomial in the order of `POLYNOMIAL`: of v³, v, v² and v⁴."""
ROUNDING = 1e-15
"""Relative differences of w and of v below this value count as rounding."""
NEWTON = 6
"""Largest number of steps of Newton's method before the search uses a bracket."""
MOST = 80
"""Largest number of steps of the secant method; every sixth step halves the bracket instead."""


@inlined
def loop_end(kind, p, periods, h, last, v):
    """h after a step from `last` to v, for a loop of type `kind`."""
    if kind == NO_LOOP or v == last:
        return h
    if kind == PLAIN:
        return plain_step(h, v - last, p[0], p[1], p[2])
    if kind == GENERAL:
        return general_step(h, v - last, p, periods[0], periods[1])
    return published_step(h, v - last, p[0], p[1], p[2], p[3])


@inlined
def static_part(poly, v):
    """p1 v³ + p2 v + p_e v² + p_4 v⁴."""
    square = v * v
    return fma(fma(poly[P1], square, poly[P2]), v, fma(poly[FOURTH], square, poly[SQUARE]) * square)


@inlined
def plays_end(c, radii, plays, v):
    """Σ c_j f_j(p_j) at v."""
    total = 0.0
    for j in range(radii.size):
        p = max(v - radii[j], min(v + radii[j], plays[j]))
        total += c[0, j] * (level_value(p, c[1, j], c[2, j], c[3, j]) if len(c) > 1 else p)
    return total


@inlined
def output(kind, p, periods, poly, c, radii, h, last, plays, v):
    """w at v."""
    w = static_part(poly, v) + loop_end(kind, p, periods, h, last, v)
    if radii.size:
        w += plays_end(c, radii, plays, v)
    return w


@inlined
def slope_at(kind, p, poly, c, radii, h, v, plays, s):
    """∂w/∂v for motion in the direction s from the state h; plays as before the sample."""
    square = v * v
    slope = fma(3.0 * poly[P1], square, poly[P2]) + 2.0 * v * fma(2.0 * poly[FOURTH], square, poly[SQUARE])
    if kind != NO_LOOP:
        slope += p[A] - (p[BETA] * s + p[GAMMA] * copysign(1.0, h)) * h
    for j in range(radii.size):
        if s * (v - plays[j]) >= radii[j] * (1.0 - 1e-9):
            held = v - s * radii[j]
            slope += c[0, j] * (level_density(held, c[1, j], c[2, j], c[3, j]) if len(c) > 1 else 1.0)
    return slope


@inlined
def solve(kind, p, periods, poly, c, radii, h, last, plays, wanted, now, orientation, low, high):
    """v in [low, high] with w(v) = wanted, or the nearer end; `now` is w at `last`, `orientation` the slope's sign."""
    gap = wanted - now
    enough = ROUNDING * (abs(wanted) + abs(now))
    if abs(gap) <= enough:
        return last
    s = copysign(orientation, gap) if orientation > 0.0 else -copysign(1.0, gap)
    edge = max(high, last) if s > 0.0 else min(low, last)
    if edge == last:
        return last
    slope = slope_at(kind, p, poly, c, radii, h, last, plays, s)
    if slope * orientation < 0.02 * abs(poly[P2]):
        slope = orientation * max(abs(poly[P2]), 1e-3)
    x = last + gap / slope
    for _ in range(NEWTON if kind <= PLAIN else 0):
        if not (s * (x - last) > 0.0 and s * (edge - x) >= 0.0):
            break
        end = loop_end(kind, p, periods, h, last, x)
        g = wanted - static_part(poly, x) - end - plays_end(c, radii, plays, x)
        if abs(g) <= enough:
            return x
        x += g / slope_at(kind, p, poly, c, radii, end, x, plays, s)
    near = last  # wanted − w has the sign of gap here
    far, closed = edge, False  # wanted − w has the other sign here, if closed
    x0, g0 = last, gap
    x = last + gap / slope
    best, best_gap = last, abs(gap)
    for k in range(MOST):
        if s * (x - near) <= 0.0 or s * (far - x) < 0.0 or (closed and x == far):
            x = 0.5 * (near + far) if closed else far
        g = wanted - output(kind, p, periods, poly, c, radii, h, last, plays, x)
        if abs(g) < best_gap:
            best, best_gap = x, abs(g)
        if abs(g) <= enough:
            return x
        if g * gap > 0.0:
            if x == edge:
                return edge
            near = x
        else:
            far, closed = x, True
        if closed and abs(far - near) <= ROUNDING * (abs(far) + abs(near)):
            return best
        change = g0 - g
        following = x + g * (x - x0) / change if change != 0.0 else far
        x0, g0 = x, g
        if k % 6 == 5:
            following = 0.5 * (near + far) if closed else x + 4.0 * (x - last)
        x = following
    return best
