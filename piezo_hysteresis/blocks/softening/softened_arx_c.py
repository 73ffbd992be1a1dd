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

"""C code of `SoftenedArxBlock` and of its inverse, one sample of their kernels."""

from __future__ import annotations

FORCE = """\
/* Force of a spring beyond the linear one. */
static double force(double x, double k2, double k3)
{
    return (k2 * fabs(x) + k3 * x * x) * x;
}
"""
"""C function of `force`."""
SETTLE = """\
/* Static deflection x with x + force(x) = w; not a number where the stiffness vanishes on the way. */
static double settle(double w, double k2, double k3)
{
    double x = w;
    int i;
    for (i = 0; i < 50; i++) {
        const double stiffness = 1.0 + (2.0 * k2 * fabs(x) + 3.0 * k3 * x * x);
        double step;
        if (!(stiffness > 0.0)) {
            return NAN;
        }
        step = (w - x - force(x, k2, k3)) / stiffness;
        x += step;
        if (fabs(step) <= 1e-15 * fabs(x)) {
            break;
        }
    }
    return x;
}
"""
"""C function of `settle`."""
REST = """\
memset(s, 0, sizeof *s);
s->w0 = x;
s->x0 = settle(x, k2, k3);
ME_path_rest(&s->path, 0.0);
return ME_linear_rest(&s->linear, x) + share * (s->x0 - x);
"""
"""C code of the state at rest."""
STEP = """\
const double gain = 1.0 + m1 + m2, w = x - s->w0;
const double excess = force(s->x0 + (s->mode[0] + s->xi[0]), k2, k3) - force(s->x0, k2, k3);
const double mode = gain * w - m1 * s->mode[0] - m2 * s->mode[1];
const double xi = -m1 * s->xi[0] - m2 * s->xi[1] - gain * excess;
s->mode[1] = s->mode[0];
s->mode[0] = mode;
s->xi[1] = s->xi[0];
s->xi[0] = xi;
return ME_linear_step(&s->linear, x) + (share * (s->x0 - s->w0) + ME_path_step(&s->path, xi));
"""
"""C code of one sample."""
FORCE_FOR = """\
const double gain = 1.0 + m1 + m2, moved = ME_path_step(&s->path, x) - s->x0;
const double w = (moved + m1 * s->z[0] + m2 * s->z[1]) / gain
    + (force(s->x0 + s->z[0], k2, k3) - force(s->x0, k2, k3));
s->z[1] = s->z[0];
s->z[0] = moved;
return s->w0 + w;
"""
"""C code of the inverse of the mode: the force that moves it along a wanted way."""
