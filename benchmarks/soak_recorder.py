# Copyright 2026 piezo_hysteresis maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""A recorder of its own process, so that it can be killed: every topic of the axis into the bag given.

Twenty times a second it notes in BAG.progress, unbuffered, the time and how many blocks of samples it has recorded.

python -m benchmarks.soak_recorder BAG --ros-args …
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

from piezo_hysteresis.nodes.identification.bag_recorder import BagRecorder
from piezo_hysteresis.nodes.runtime.guarded_node import GuardedNode
from piezo_hysteresis.nodes.runtime.process import run


class Recorder(GuardedNode):
    """A node that records until it ends."""

    def __init__(self) -> None:
        super().__init__("recorder")
        self.bag = BagRecorder(self, Path(sys.argv[1]))
        self._log = Path(sys.argv[1] + ".progress").open("wb", buffering=0)  # noqa: SIM115
        self.create_timer(0.05, self._note)

    def _note(self) -> None:
        self._log.write(np.array([time.monotonic(), self.bag.counts["samples"]]).tobytes())


if __name__ == "__main__":
    sys.exit(run(Recorder, sys.argv[2:], end=lambda node: node.bag.close()))
