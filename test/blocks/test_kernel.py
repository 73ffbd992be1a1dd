"""What kernels promise beyond being fast."""

from __future__ import annotations

from piezo_hysteresis.blocks.kernel import fma, kernel

EPSILON = 2.0**-30


@kernel
def less_than_a_square(x: float) -> float:
    """(1 + x)(1 − x) − 1 = −x²."""
    return fma(1.0 + x, 1.0 - x, -1.0)


def test_product_and_sum_are_rounded_once():
    assert (1.0 + EPSILON) * (1.0 - EPSILON) - 1.0 == 0.0  # rounded twice, the square is lost
    assert less_than_a_square(EPSILON) == -(EPSILON**2)
