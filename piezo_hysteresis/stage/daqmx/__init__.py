"""Stages behind an amplifier and a sensor that are wired to a National Instruments card, through NI-DAQmx.

``stage`` is the back end and ``setup`` its wiring and scales; ``loop_back`` measures the delay of the card alone;
``emulator`` is an NI gRPC device server without hardware. All of it needs the optional package ``nidaqmx[grpc]``.
"""
