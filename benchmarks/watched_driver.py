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

"""A driver whose stage logs every voltage that it receives, sample by sample, before it uses it.

    python watched_driver.py LOG --ros-args …

If there is a file LOG.clock, the clock of the computer is wrong by the seconds in it, for this process only.

A start of the process is a NaN in the log. A killed driver cannot leave a sample out, because the operating system gets
the samples of a block before the stage does.
"""

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from piezo_hysteresis.nodes.driver import driver_node
from piezo_hysteresis.stage import back_ends

CLOCK = time.time_ns

SIMULATED = back_ends.BACK_ENDS["simulated"]


def watched(stage, log):
    """The simulated stage, each sample of its wire written down before its plant sees it."""
    run = stage._plant.run

    def noted(voltage):
        log.write(np.ascontiguousarray(voltage).tobytes())
        return run(voltage)

    stage._plant.run = noted
    return stage


def shifted(offset):
    """The clock of the computer, off by the seconds in a file."""

    def time_ns():
        try:
            return CLOCK() + round(float(offset.read_text()) * 1e9)
        except (OSError, ValueError):
            return CLOCK()

    return time_ns


if __name__ == "__main__":
    time.time_ns = shifted(Path(f"{sys.argv[1]}.clock"))
    with Path(sys.argv[1]).open("ab", buffering=0) as log:
        log.write(np.array([np.nan]).tobytes())
        noted = replace(SIMULATED, open=lambda *values: watched(SIMULATED.open(*values), log))
        back_ends.BACK_ENDS["simulated"] = noted
        sys.exit(driver_node.main(sys.argv[2:]))
