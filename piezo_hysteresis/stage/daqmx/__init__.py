"""Stages whose amplifier and sensor are wired to a National Instruments card.

``stage`` is the back end and ``setup`` its wiring and scales. ``loop_back`` measures the delay of the card alone.
The optional package ``nidaqmx[grpc]`` is needed.
"""
