"""Emulates an NI gRPC device server with a card that is wired to a simulated stage.

``server`` answers the calls that a pair of clocked analogue tasks needs, ``card`` is the card with its buffers.
"""
