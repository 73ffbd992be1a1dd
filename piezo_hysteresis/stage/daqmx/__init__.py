"""Stages whose amplifier and sensor are wired to a National Instruments card.

``stage`` is the back end, ``setup`` its wiring and scales, and ``back_end`` its parameters for the driver.
``loop_back`` measures the delay of the card alone. The optional package ``nidaqmx[grpc]`` is needed.
"""

from .back_end import PARAMETERS, open

__all__ = ["PARAMETERS", "open"]
