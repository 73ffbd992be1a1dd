"""Lengths and times as a physicist says them."""

from __future__ import annotations


def nanometre(metres: float) -> str:
    """A length for reading: nm below a micrometre, else µm.

    >>> nanometre(1.234e-8), nanometre(2.5e-6)
    ('12.3 nm', '2.5 µm')
    """
    return f"{metres * 1e9:.3g} nm" if abs(metres) < 1e-6 else f"{metres * 1e6:.3g} µm"


def duration(seconds: float) -> str:
    """A time for reading.

    >>> duration(2e-5), duration(0.25), duration(175.0)
    ('20 µs', '250 ms', '175 s')
    """
    for unit, factor in (("s", 1.0), ("ms", 1e3), ("µs", 1e6)):
        if seconds * factor >= 1.0:
            return f"{seconds * factor:.4g} {unit}"
    return f"{seconds * 1e9:.4g} ns"
