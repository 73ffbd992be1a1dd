"""Stages on controllers that speak PI's General Command Set 2.0 over TCP.

``stage`` is the back end, ``setup`` its wiring and scales; ``axis`` asks and tells one axis, ``client`` knows the
syntax and the error queue, ``connection`` the link, ``array`` the tables of numbers. ``emulator`` is a controller
without hardware.
"""
