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

"""`Campaign`: an axis that is identified, its wire watched sample by sample, and blows at chosen moments."""

import os
from contextlib import ExitStack

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from std_srvs.srv import Trigger

from benchmarks.stage_log import StageLog
from benchmarks.wire import LSB, PERIOD, RAMP, SAFE_WITHIN, SLEW, TOP, device
from piezo_hysteresis.nodes.messages.conversions import values_of
from piezo_hysteresis.nodes.messages.samples import SampleReader
from piezo_hysteresis.nodes.runtime.qos import COMMAND_STATUS, LATCHED
from piezo_hysteresis.recording import Bag

NODE = "identification_node"
LIMITS = {"voltage_min": 0.0, "voltage_max": 10.0, "max_slew_rate": 4e4, "ramp_rate": 40.0}
"""Of the simulated stage."""
BUSY = ("waiting", "running", "fitting")
CLAIM_TIMEOUT = 4.0
"""Time after which who was stopped has lost its claim [s]; a busy machine takes a second or two."""
ON_THEIR_WAY = 1.5
"""What may be in the memory of a recorder that is killed on a busy machine, and in that of the middleware [s]."""


class SimulatedAxis:
    """A stage in the process of its driver, four times as fast as the clock; what it was given is in a file."""

    speed = 4.0
    has_keeper = False

    def __init__(self, lab):
        self._lab, self._log = lab, StageLog(lab.folder / "voltages", PERIOD, **LIMITS)

    def driver(self):
        named = {"sample_period": PERIOD, "real_time_factor": self.speed, "block_duration": 0.01 * self.speed}
        named |= {"claim_timeout": CLAIM_TIMEOUT, **LIMITS}
        return self._lab.driver(program=self._log.driver, environment=self._log.environment, **named)

    def moves(self, samples, above):
        return samples.newest.voltage.max() > above

    def await_safe(self):
        """Where the stage died with its driver, the next one begins at the safe voltage: `check` sees it."""

    def check(self):
        self._log.check()

    def close(self):
        """Nothing outlives the processes of the lab."""


class ControllerAxis:
    """A controller with memory behind a socket, which outlives its drivers; a keeper stands beside them."""

    speed = 1.0
    has_keeper = True

    def __init__(self, lab):
        self._lab, self._stack = lab, ExitStack()
        self._word, self._parameters, self._amplifier, _ = self._stack.enter_context(device("gcs2"))

    def driver(self):
        limits = {"voltage_max": TOP, "max_slew_rate": SLEW, "ramp_rate": RAMP}
        own = {f"{self._word}__{name}": value for name, value in self._parameters.items()}
        own[f"{self._word}__points_per_command"] = 2000
        named = {"sample_period": PERIOD, "keeper_timeout": 2.0, "claim_timeout": CLAIM_TIMEOUT, **limits, **own}
        return self._lab.driver(stage=self._word, **named)

    def moves(self, samples, above):
        """Seen at the wire: samples come when a waveform has ended."""
        return self._amplifier.output > above

    def await_safe(self):
        self._lab.wait(lambda: abs(self._amplifier.output) <= SAFE_WITHIN, "the safe voltage at the wire")

    def check(self):
        wire = self._amplifier.wire
        assert wire.min() >= -LSB
        assert wire.max() <= TOP + LSB
        assert np.abs(np.diff(wire)).max() <= SLEW * PERIOD + 2 * LSB

    def close(self):
        for process in self._lab.processes:
            process.end()
        self._stack.close()


class Campaign:
    """A driver and an identification node; both can be killed, stopped and started again."""

    def __init__(self, lab, kind=SimulatedAxis):
        self.lab, self.axis = lab, kind(lab)
        self.root = lab.folder / "runs"
        self.statuses = lab.listen(DiagnosticStatus, "status", LATCHED)
        self._begun, self._ended_phases, self._at_end = 0, 0, lambda phase: None
        lab.node.create_subscription(DiagnosticStatus, "command_status", self._on_command_status, COMMAND_STATUS)
        self.start_driver()
        self.start_node()

    def start_driver(self):
        self.driver = self.axis.driver()
        self.samples = self.lab.streaming()

    def start_node(self):
        self.node = self.lab.start(NODE, experiment_root=str(self.root))

    def ask(self, name):
        return self.lab.call(Trigger, f"{NODE}/{name}")

    def state(self):
        return values_of(self.statuses[-1])["state"] if self.statuses else ""

    def await_state(self, *states, timeout=120.0):
        """The last status, once it is one of `states`."""
        self.lab.wait(lambda: self.state() in states, f"state {' or '.join(states)}, not {self.statuses[-1:]}", timeout)
        return self.statuses[-1]

    def await_limits(self):
        self.lab.wait(lambda: self.ask("plan").success, "the driver's limits", 120.0)

    def begin(self):
        """An identification that runs, as soon as driver and claim allow one."""

        def runs():
            if self.state() not in BUSY:
                self.ask("identify")
            self.lab.pause(0.3)
            return self.state() == "running"

        self.lab.wait(runs, "an identification that runs", 120.0)
        self._begun = int(self.samples.newest.index[-1])

    def await_phase(self, number, above):
        """Wait until a phase is played and the voltage is above a value [V]."""

        def moves():
            phase = values_of(self.statuses[-1])["phase"]
            return phase.startswith(f"{number} of") and self.axis.moves(self.samples, above)

        self.lab.wait(moves, f"motion in phase {number}", 120.0)

    def at_the_end_of_a_phase(self, strike, number=2):
        """Call `strike` the moment that the driver reports the end of phase `number`, and wait until it was called."""
        struck = []

        def at_end(phase):
            if phase == number:
                self._at_end = lambda phase: None
                struck.append(strike())

        self.begin()
        self._ended_phases, self._at_end = 0, at_end
        self.lab.wait(lambda: struck, f"the end of phase {number}", 120.0)

    def _on_command_status(self, status):
        if values_of(status)["state"] == "done":
            self._ended_phases += 1
            self._at_end(self._ended_phases)

    def rests(self):
        """Half a second of stage time at the safe voltage."""
        begin = len(self.samples.blocks)
        self.lab.wait(lambda: len(self.samples.blocks) > begin + 50, "half a second", 120.0)
        self.lab.wait(
            lambda: all((np.abs(b.voltage) < 2 * SAFE_WITHIN).all() for b in self.samples.blocks[-50:]), "rest", 120.0
        )

    def newest_recording(self):
        return max(path for path in self.root.iterdir() if list(path.glob("*.mcap")))

    def recorded(self, folder):
        """Index of the first sample of each block in a recording."""
        reader = SampleReader()
        return {int(reader.read(message.raw).index[0]) for message in Bag(folder).messages({"/samples"})}

    def check_kept(self, folder, heard):
        """What was heard of a recording longer than a moment before its writer was struck is in it, every block."""
        last = int(heard.newest.index[-1]) - round(ON_THEIR_WAY * self.axis.speed / PERIOD)
        wanted = {int(b.index[0]) for b in heard.blocks if self._begun <= b.index[0] and b.index[-1] < last}
        missing = wanted - self.recorded(folder)
        assert not missing, f"{len(missing)} of {len(wanted)} blocks are missing"

    def check(self):
        """Every recording can be read, no voltage was outside the limits, and both processes live."""
        for folder in self.root.iterdir():
            if list(folder.glob("*.mcap")):
                self.recorded(folder)
        self.axis.check()
        assert self.driver.is_running
        assert self.node.is_running


def children(pid):
    """Processes started by a process."""
    found = []
    for name in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open(f"/proc/{name}/stat") as stat:
                parent = int(stat.read().rpartition(")")[2].split()[1])
        except OSError:
            continue
        if parent == pid:
            found.append(int(name))
    return found
