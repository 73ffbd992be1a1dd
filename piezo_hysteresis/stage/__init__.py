"""Stages: what the driver moves.

``stage`` is the protocol and ``description`` the limits of a device; ``simulated`` offers a simulated stage of both
kinds, ``plant`` is its physics and ``hidden`` puts something in it that its user does not know; ``replay`` plays a
recording.
"""
