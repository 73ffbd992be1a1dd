"""Stages that a driver can move: simulated, replayed and real ones.

``stage`` is the protocol. ``description`` holds the limits of a device. ``simulated`` offers simulated stages,
streaming and with memory; ``plant`` is their physics; ``hidden`` adds an effect to the plant that its user does not
know. ``replay`` plays a recording.
"""
