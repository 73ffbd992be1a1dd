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

"""C code of `hysteresis_solver`: the same functions, for every kind of loop and of plays."""

from __future__ import annotations

from ..inverse_terms import GENERAL, NO_LOOP, PLAIN, PUBLISHED
from .hysteresis_solver import MOST, NEWTON, ROUNDING

LOOP_END_IN_C = {
    NO_LOOP: f"enum {{ NEWTON = {NEWTON} }};\n#define LOOP_END(p, h, dv) (h)\n",
    PLAIN: f"enum {{ NEWTON = {NEWTON} }};\n#define LOOP_END(p, h, dv) plain_step(h, dv, p[0], p[1], p[2])\n",
    GENERAL: "enum { NEWTON = 0 };\n#define LOOP_END(p, h, dv) general_step(h, dv, p, p[8], p[9])\n",
    PUBLISHED: "enum { NEWTON = 0 };\n#define LOOP_END(p, h, dv) published_step(h, dv, p[0], p[1], p[2], p[3])\n",
}
"""C code of `loop_end` for every kind of loop; p contains its parameters and then both periods."""
_ROOT = "(b)->root[(j)], (b)->root[(b)->plays + (j)], (b)->root[2 * (b)->plays + (j)]"
"""Arguments a, b and q of the functions of `level_density`, for play j."""
PLAYS_IN_C = "#define PLAY_VALUE(b, j, p) (p)\n#define PLAY_DENSITY(b, j, p) 1.0\n"
"""C code of a play whose weight is constant."""
LEVEL_PLAYS_IN_C = (
    f"#define PLAY_VALUE(b, j, p) level_value(p, {_ROOT})\n#define PLAY_DENSITY(b, j, p) level_density(p, {_ROOT})\n"
)
"""C code of a play whose weight depends on the level."""
SOLVE_IN_C = (
    f"""\
static const double ROUNDING = {ROUNDING!r};
enum {{ MOST = {MOST} }};

"""
    """\
/* A hysteresis before a sample: loop, polynomial p1, p2, p_e, p_4, plays. */
typedef struct {
    const double *p, *poly, *c, *root, *radius, *play;
    int plays;
    double h, v;
} hysteresis_before;

/* h after the loop has gone to v. */
static double loop_end(const hysteresis_before *b, double v)
{
    return v == b->v ? b->h : LOOP_END(b->p, b->h, v - b->v);
}

/* w at v without the loop. */
static double without_loop(const hysteresis_before *b, double v)
{
    const double *poly = b->poly, square = v * v;
    double total = 0.0;
    int j;
    for (j = 0; j < b->plays; j++) {
        const double p = larger(v - b->radius[j], smaller(v + b->radius[j], b->play[j]));
        total += b->c[j] * PLAY_VALUE(b, j, p);
    }
    return FMA(FMA(poly[0], square, poly[1]), v, FMA(poly[3], square, poly[2]) * square) + total;
}

/* dw/dv for motion in the direction s from the state h. */
static double slope_at(const hysteresis_before *b, double h, double v, double s)
{
    const double *poly = b->poly, square = v * v;
    double slope = FMA(3.0 * poly[0], square, poly[1]) + 2.0 * v * FMA(2.0 * poly[3], square, poly[2]);
    int j;
    slope += b->p[0] - (b->p[1] * s + b->p[2] * copysign(1.0, h)) * h;
    for (j = 0; j < b->plays; j++) {
        if (s * (v - b->play[j]) >= b->radius[j] * (1.0 - 1e-9)) {
            slope += b->c[j] * PLAY_DENSITY(b, j, v - s * b->radius[j]);
        }
    }
    return slope;
}

/* v in [low, high] with w(v) = wanted; without a solution, the end of the interval in this direction. `now` is w before
   the sample. Newton's method is used while it stays inside, otherwise the secant method in a bracket. */
static double solve(
    const hysteresis_before *b, double wanted, double now, double orientation, double low, double high)
{
    const double last = b->v, gap = wanted - now, enough = ROUNDING * (fabs(wanted) + fabs(now));
    const double s = copysign(1.0, gap) * orientation, edge = s > 0.0 ? larger(high, last) : smaller(low, last);
    double slope, x, x0 = last, g, g0 = gap, near_ = last, far_ = edge, best = last, best_gap = fabs(gap);
    int k, closed = 0;
    if (fabs(gap) <= enough || edge == last) {
        return last;
    }
    slope = slope_at(b, b->h, last, s);
    if (slope * orientation < 0.02 * fabs(b->poly[1])) {
        slope = orientation * larger(fabs(b->poly[1]), 1e-3);
    }
    x = last + gap / slope;
    for (k = 0; k < NEWTON && s * (x - last) > 0.0 && s * (edge - x) >= 0.0; k++) {
        const double end = loop_end(b, x);
        g = wanted - without_loop(b, x) - end;
        if (fabs(g) <= enough) {
            return x;
        }
        x += g / slope_at(b, end, x, s);
    }
    x = last + gap / slope;
    for (k = 0; k < MOST; k++) {
        double following;
        if (s * (x - near_) <= 0.0 || s * (far_ - x) < 0.0 || (closed && x == far_)) {
            x = closed ? 0.5 * (near_ + far_) : far_;
        }
        g = wanted - (without_loop(b, x) + loop_end(b, x));
        if (fabs(g) < best_gap) {
            best = x;
            best_gap = fabs(g);
        }
        if (fabs(g) <= enough || (g * gap > 0.0 && x == edge)) {
            return x;
        }
        if (g * gap > 0.0) {
            near_ = x;
        } else {
            far_ = x;
            closed = 1;
        }
        if (closed && fabs(far_ - near_) <= ROUNDING * (fabs(far_) + fabs(near_))) {
            return best;
        }
        following = g0 != g ? x + g * (x - x0) / (g0 - g) : far_;
        x0 = x;
        g0 = g;
        if (k % 6 == 5) {
            following = closed ? 0.5 * (near_ + far_) : x + 4.0 * (x - last);
        }
        x = following;
    }
    return best;
}
"""
)
"""C functions of `solve` and the functions that it calls."""
