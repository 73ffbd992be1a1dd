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

"""The function of one play whose weight depends on its position: f(p) = ∫₀ᵖ (a + b s + q s²)² ds.

The weight of a play is the density of a Preisach operator along the level. As a square it is never negative, so that f
rises for all numbers a, b and q, and the operator can be inverted.
"""

from __future__ import annotations

from ...blocks.kernel import inlined


@inlined
def level_value(p, a, b, q):
    """f(p)."""
    return p * (a * a + p * (a * b + p * ((b * b + 2.0 * a * q) / 3.0 + p * (0.5 * b * q + p * (0.2 * q * q)))))


@inlined
def level_density(p, a, b, q):
    """∂f/∂p = (a + b p + q p²)²."""
    root = a + p * (b + p * q)
    return root * root


@inlined
def level_slopes(p, a, b, q, m):
    """∂f/∂k and ∂f/∂q for a = 1 − k m + q m² and b = k − 2 q m."""
    first = p * (2.0 * a + p * (b + p * (q * (2.0 / 3.0))))
    second = p * p * (a + p * (b * (2.0 / 3.0) + p * (0.5 * q)))
    third = p * p * p * (a * (2.0 / 3.0) + p * (0.5 * b + p * (0.4 * q)))
    return second - m * first, third - 2.0 * m * second + m * m * first


VALUE_IN_C = """\
/* Integral of (a + b s + q s^2)^2 from 0 to p. */
static double level_value(double p, double a, double b, double q)
{
    return p * (a * a + p * (a * b + p * ((b * b + 2.0 * a * q) / 3.0 + p * (0.5 * b * q + p * (0.2 * q * q)))));
}
"""
"""C function of `level_value`."""
DENSITY_IN_C = """\
/* The derivative of level_value by p. */
static double level_density(double p, double a, double b, double q)
{
    const double root = a + p * (b + p * q);
    return root * root;
}
"""
"""C function of `level_density`."""
