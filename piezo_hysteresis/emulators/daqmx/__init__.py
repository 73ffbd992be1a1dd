"""An NI gRPC device server without hardware: a simulated stage wired to an emulated card.

``server`` answers the calls that a pair of clocked analogue tasks needs, ``card`` is the card with its buffers.
"""
