"""Faults strike real node processes over real DDS, in the lab of the node tests."""

from ..nodes.conftest import lab, shared_lab

__all__ = ["lab", "shared_lab"]
