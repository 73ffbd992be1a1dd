// Copyright 2026 piezo_hysteresis maintainers
//
// Licensed under the Apache License, Version 2.0 (the "License");
// you may not use this file except in compliance with the License.
// You may obtain a copy of the License at
//
//     http://www.apache.org/licenses/LICENSE-2.0
//
// Unless required by applicable law or agreed to in writing, software
// distributed under the License is distributed on an "AS IS" BASIS,
// WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
// See the License for the specific language governing permissions and
// limitations under the License.

/* The inverse of creep and hysteresis as one would write it in C, with the arithmetic of the package: relaxations solved
   algebraically, the exact Bouc-Wen step turned round by Newton's method, plays beside it, limits in the loop. The
   dynamics are taps and a recursion of eight before it. */

#include <math.h>

static double decay(double r, double length)
{
    const double x = r * length;
    if (fabs(x) < 0.02)
        return length * (1.0 - x * (0.5 - x * (1.0 / 6.0 - x * (1.0 / 24.0 - x * (1.0 / 120.0 - x * (1.0 / 720.0))))));
    return -expm1(-x) / r;
}

static double step(double h, double dv, double A, double beta, double gamma)
{
    const double s = copysign(1.0, dv), length = fabs(dv), drive = s * A;
    const double r_above = beta + gamma * s, r_below = beta - gamma * s;
    const double above = decay(r_above, length), below = decay(r_below, length);
    const int is_above = h > 0.0 || (h == 0.0 && drive > 0.0);
    const double r_same = is_above ? r_above : r_below;
    double end = h + (drive - r_same * h) * (is_above ? above : below);
    if (end * h < 0.0) {
        const double r_flipped = is_above ? r_below : r_above;
        const double zero = fabs(r_same) < 1e-12 ? -h / drive : log1p(-h * r_same / drive) / r_same;
        end = drive * decay(r_flipped, fmax(0.0, length - zero));
    }
    return end;
}

static double output(const double *p, const double *c, const double *radii, long plays, const double *held, double v)
{
    double total = 0.0;
    for (long j = 0; j < plays; j++)
        total += c[j] * fmax(v - radii[j], fmin(v + radii[j], held[j]));
    return p[3] * v * v * v + p[4] * v + total;
}

static double slope_at(const double *p, const double *c, const double *radii, long plays, double h, double v,
                       const double *held, double s)
{
    double slope = 3.0 * p[3] * v * v + p[4] + p[0] - (p[1] * s + p[2] * copysign(1.0, h)) * h;
    for (long j = 0; j < plays; j++)
        if (s * (v - held[j]) >= radii[j] * (1.0 - 1e-9))
            slope += c[j];
    return slope;
}

/* y (n + taps - 1) to targets (n); a has eight coefficients. */
void dynamics(const double *y, long n, const double *taps, long count, const double *a, double *targets)
{
    double y1 = 0, y2 = 0, y3 = 0, y4 = 0, y5 = 0, y6 = 0, y7 = 0, y8 = 0;
    for (long i = 0; i < n; i++)
        targets[i] = 0.0;
    for (long k = 0; k < count; k++)
        for (long i = 0; i < n; i++)
            targets[i] += taps[k] * y[i + count - 1 - k];
    for (long i = 0; i < n; i++) {
        double sum = targets[i];
        sum -= a[7] * y8, sum -= a[6] * y7, sum -= a[5] * y6, sum -= a[4] * y5;
        sum -= a[3] * y4, sum -= a[2] * y3, sum -= a[1] * y2, sum -= a[0] * y1;
        y8 = y7, y7 = y6, y6 = y5, y5 = y4, y4 = y3, y3 = y2, y2 = y1, y1 = sum;
        targets[i] = sum;
    }
}

/* targets (n) to u (n); p = [A, beta, gamma, p1, p2], limits = [volt, low, high, largest step]; from rest at 0. */
void invert(const double *targets, long n, const double *p, const double *c, const double *radii, long plays,
            double *held, const double *fade, const double *lead, const double *weights, long banks, double direct,
            const double *limits, double *x, double *ahead, double *u)
{
    double h = 0.0, last = 0.0, now = 0.0, before = 0.0, u_last = 0.0, gain = 1.0 + direct;
    for (long j = 0; j < banks; j++)
        gain += weights[j] * lead[j], x[j] = 0.0;
    for (long j = 0; j < plays; j++)
        held[j] = 0.0;
    for (long i = 0; i < n; i++) {
        double rest = 0.0, v = last;
        for (long j = 0; j < banks; j++) {
            ahead[j] = x[j] + fade[j] * (before - x[j]);
            rest += weights[j] * (ahead[j] - lead[j] * before);
        }
        const double wanted = (targets[i] - rest) / gain, gap = wanted - now;
        const double enough = 1e-15 * (fabs(wanted) + fabs(now));
        if (fabs(gap) > enough) {
            const double s = copysign(1.0, gap);
            double end = h;
            v += gap / slope_at(p, c, radii, plays, end, v, held, s);
            for (int k = 0; k < 80; k++) {
                end = step(h, v - last, p[0], p[1], p[2]);
                const double g = wanted - output(p, c, radii, plays, held, v) - end;
                if (fabs(g) <= enough)
                    break;
                v += g / slope_at(p, c, radii, plays, end, v, held, s);
            }
        }
        u[i] = fmin(fmax(v * limits[0], u_last - limits[3]), u_last + limits[3]);
        u[i] = fmin(fmax(u[i], limits[1]), limits[2]);
        u_last = u[i], v = u[i] / limits[0];
        if (v != last)
            h = step(h, v - last, p[0], p[1], p[2]);
        last = v, now = p[3] * v * v * v + p[4] * v + h;
        double total = 0.0;
        for (long j = 0; j < plays; j++) {
            held[j] = fmax(v - radii[j], fmin(v + radii[j], held[j]));
            total += c[j] * held[j];
        }
        now += total;
        for (long j = 0; j < banks; j++)
            x[j] = ahead[j] + lead[j] * (now - before);
        before = now;
    }
}
