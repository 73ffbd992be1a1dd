"""A recorder of its own process, so that it can be killed: every topic of the axis into the bag given.

python -m benchmarks.soak_recorder BAG --ros-args …
"""

from __future__ import annotations

import sys
from pathlib import Path

from rclpy.node import Node

from piezo_hysteresis.nodes.bag_recorder import BagRecorder
from piezo_hysteresis.nodes.process import run


class Recorder(Node):
    """A node that records until it ends."""

    def __init__(self) -> None:
        super().__init__("recorder")
        self.bag = BagRecorder(self, Path(sys.argv[1]))


if __name__ == "__main__":
    sys.exit(run(Recorder, sys.argv[2:], end=lambda node: node.bag.close()))
