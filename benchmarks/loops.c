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

/* The published model as one would write it in C: Eq. (6) and (7), and Eq. (5) with eight of each behind a delay. */

#include <math.h>

/* p = [A, beta, gamma, p1, p2]; v from rest at v[0]. */
void bouc_wen(const double *v, long n, const double *p, double *w)
{
    const double A = p[0], beta = p[1], gamma = p[2], p1 = p[3], p2 = p[4];
    double h = 0.0, last = v[0];
    for (long i = 0; i < n; i++) {
        const double x = v[i], dv = x - last;
        h += A * dv - beta * fabs(dv) * h - gamma * dv * fabs(h);
        last = x;
        w[i] = p1 * x * x * x + p2 * x + h;
    }
}

/* u in volts to y in metres, in one loop: both recursions run beside each other. w is room for n + delay + 7 numbers;
   the filter acts on what deviates from rest. */
void chain(const double *u, long n, double volt, double metre, const double *p, long delay, const double *a,
           const double *b, double gain, double *w, double *y)
{
    const double A = p[0], beta = p[1], gamma = p[2], p1 = p[3], p2 = p[4];
    const double a1 = a[0], a2 = a[1], a3 = a[2], a4 = a[3], a5 = a[4], a6 = a[5], a7 = a[6], a8 = a[7];
    const double b1 = b[0], b2 = b[1], b3 = b[2], b4 = b[3], b5 = b[4], b6 = b[5], b7 = b[6], b8 = b[7];
    double y1 = 0, y2 = 0, y3 = 0, y4 = 0, y5 = 0, y6 = 0, y7 = 0, y8 = 0;
    double h = 0.0, last = u[0] / volt;
    const double w0 = p1 * last * last * last + p2 * last, y0 = gain * w0, per_volt = 1.0 / volt;
    for (long i = 0; i < delay + 7; i++)
        w[i] = 0.0;
    for (long i = 0; i < n; i++) {
        const double x = u[i] * per_volt, dv = x - last, *past = w + i;
        h += A * dv - beta * fabs(dv) * h - gamma * dv * fabs(h);
        last = x;
        w[i + delay + 7] = p1 * x * x * x + p2 * x + h - w0;
        double sum = ((b1 * past[7] + b2 * past[6]) + (b3 * past[5] + b4 * past[4]))
                     + ((b5 * past[3] + b6 * past[2]) + (b7 * past[1] + b8 * past[0]));
        sum -= a8 * y8;
        sum -= a7 * y7;
        sum -= a6 * y6;
        sum -= a5 * y5;
        sum -= a4 * y4;
        sum -= a3 * y3;
        sum -= a2 * y2;
        sum -= a1 * y1;
        y8 = y7, y7 = y6, y6 = y5, y5 = y4, y4 = y3, y3 = y2, y2 = y1, y1 = sum;
        y[i] = metre * (y0 + sum);
    }
}
