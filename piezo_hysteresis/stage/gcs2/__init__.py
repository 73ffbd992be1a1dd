"""Stages on PI controllers with the General Command Set 2.0 over TCP.

``stage`` is the back end, ``setup`` its wiring and scales, and ``back_end`` its parameters for the driver. ``axis``
sends commands to one axis and reads its answers. ``client`` knows the syntax and the error queue, ``connection`` the
link, and ``array_answer`` the tables of numbers.
"""

from .back_end import PARAMETERS, open

__all__ = ["PARAMETERS", "open"]
