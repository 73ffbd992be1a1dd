"""Emulates a GCS 2.0 controller: a simulated stage behind a real TCP port.

``server`` is the port and ``controller`` carries out the commands. ``motion`` keeps the simulated stage moving in real
time. ``wave`` and ``recorder`` are its memories. ``faults`` lists the faults that can be injected.
"""
