"""Stages on PI controllers with the General Command Set 2.0 over TCP.

``stage`` is the back end and ``setup`` its wiring and scales. ``axis`` sends commands to one axis and reads its
answers. ``client`` knows the syntax and the error queue, ``connection`` the link, and ``array`` the tables of numbers.
"""
