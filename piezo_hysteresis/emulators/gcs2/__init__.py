"""A GCS 2.0 controller without hardware: a simulated stage behind a real TCP port.

``server`` is the port, ``controller`` carries out commands, ``motion`` keeps the simulated stage moving in real time,
``wave`` and ``recorder`` are its memories, ``faults`` what can be made to go wrong.
"""
