"""An identification under fire: killed, stopped and asked everything at once; from several seeds.

Every test ends with a look into the log of the stage, which notes each voltage that it was given. It takes minutes:
`-m soak`.
"""

import random
import signal

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from benchmarks.stage_log import StageLog
from piezo_hysteresis.errors import RecordingError
from piezo_hysteresis.nodes.messages.conversions import values_of
from piezo_hysteresis.nodes.runtime.qos import LATCHED
from piezo_hysteresis.recording import read

pytestmark = [pytest.mark.nodes, pytest.mark.soak]

PERIOD = 1e-4
NODE = "identification_node"
LIMITS = {"voltage_min": 0.0, "voltage_max": 10.0, "max_slew_rate": 4e4, "ramp_rate": 40.0}
BUSY = ("waiting", "running", "fitting")


class Range:
    """A driver whose stage notes every voltage, and an identification node; both can be killed and started again."""

    def __init__(self, lab):
        self.lab, self.log = lab, StageLog(lab.folder / "voltages", PERIOD, **LIMITS)
        self.statuses = lab.listen(DiagnosticStatus, "status", LATCHED)
        self.root = lab.folder / "runs"
        self.start_driver()
        self.start_node()

    def start_driver(self):
        named = {"sample_period": PERIOD, "real_time_factor": 4.0, "claim_timeout": 2.0, **LIMITS}
        self.driver = self.lab.driver(program=self.log.driver, environment=self.log.environment, **named)
        self.samples = self.lab.streaming()

    def start_node(self):
        self.process = self.lab.start(NODE, experiment_root=str(self.root))

    def ask(self, name):
        return self.lab.call(Trigger, f"{NODE}/{name}")

    def state(self):
        return values_of(self.statuses[-1])["state"] if self.statuses else ""

    def await_state(self, *states, timeout=120.0):
        self.lab.wait(lambda: self.state() in states, f"state {' or '.join(states)}, not {self.state()}", timeout)
        return self.statuses[-1].message

    def begin(self):
        """An identification that runs, as soon as driver and claim allow one."""

        def runs():
            if self.state() not in BUSY:
                self.ask("identify")
            self.lab.pause(0.3)
            return self.state() == "running"

        self.lab.wait(runs, "an identification that runs", 120.0)

    @staticmethod
    def _size(folder):
        """Samples of a recording; none where it ended before the first of them came."""
        try:
            return sum(record.size for record in read(folder, include=("idle", "hold")))
        except RecordingError as error:
            if "no readable samples" in str(error) or not list(folder.glob("*.mcap")):
                return 0
            raise

    def rests(self):
        """Half a second of stage time at the safe voltage."""
        begin = len(self.samples.blocks)
        self.lab.wait(lambda: len(self.samples.blocks) > begin + 50, "half a second", 120.0)
        self.lab.wait(lambda: all((b.voltage < 1e-3).all() for b in self.samples.blocks[-50:]), "rest", 120.0)

    def readable(self):
        """Every recording can be read, whatever became of its writer; at least one of them holds samples."""
        sizes = [self._size(folder) for folder in self.root.iterdir()]
        assert max(sizes) > 0


def moment(phase, range_, chance):
    """Be at some moment of a phase."""
    lab = range_.lab
    if phase == "waiting":
        range_.ask("identify")
        lab.pause(chance.uniform(0.0, 0.3))
    else:
        range_.begin()
        lab.pause(chance.uniform(0.0, 1.0))


@pytest.mark.parametrize("phase", ["waiting", "first phase"])
def test_killed_or_stopped_while_waiting_and_in_motion(lab, phase):
    """Driver and node, killed or stopped for longer than the claim lasts: safe, readable, and the next run works."""
    range_, chance = Range(lab), random.Random(phase)
    lab.wait(lambda: range_.ask("plan").success, "the driver's limits")
    for victim in ("driver", "node"):
        for number in (signal.SIGKILL, signal.SIGSTOP):
            moment(phase, range_, chance)
            process = range_.driver if victim == "driver" else range_.process
            process.signal(number)
            if number == signal.SIGSTOP:
                lab.pause(chance.uniform(2.5, 3.5))
                process.signal(signal.SIGCONT)
            else:
                process.wait()
                lab.pause(0.5)
                range_.start_driver() if victim == "driver" else range_.start_node()
            if victim == "driver" or number == signal.SIGSTOP:
                lab.wait(lambda: range_.state() not in BUSY, "the end of the run", 120.0)
            if range_.state() in BUSY and (victim, number) != ("node", signal.SIGKILL):
                range_.ask("abort")
            lab.wait(lambda: range_.ask("plan").success, "the driver's limits")
            range_.rests()
    range_.begin()
    assert range_.ask("abort").success
    range_.rests()
    range_.readable()
    range_.log.check()
    assert range_.driver.is_running
    assert range_.process.is_running


def odd_parameters(chance):
    """Parameters of every type, some of a type that does not exist."""
    names = ["seed", "protocol", "driver", "experiment", "model.valid", "use_sim_time", "x" * 5000, "", "."]
    values = [-3, 2**63 - 1, float("nan"), "word\x00\n", True, [1, 2], ["a"], [float("inf")], [b"\x00"]]
    message = Parameter(chance.choice(names), value=chance.choice(values)).to_parameter_msg()
    if chance.random() < 0.1:
        message.value = ParameterValue(type=99)
    return SetParameters.Request(parameters=[message])


@pytest.mark.parametrize("number", [1, 2, 3])
def test_storms_of_calls_and_parameters_leave_an_identification_that_works(lab, number):
    """Identify, diagnose, plan, abort and parameters without order, hundreds of them."""
    range_, chance, asked = Range(lab), random.Random(number), []
    lab.wait(lambda: range_.ask("plan").success, "the driver's limits")
    words = ("identify", "diagnose", "abort", "plan")
    clients = {name: lab.node.create_client(Trigger, f"{NODE}/{name}") for name in words}
    parameters = lab.node.create_client(SetParameters, f"{NODE}/set_parameters")
    for client in (*clients.values(), parameters):
        lab.wait(client.service_is_ready, "the services")
    for _ in range(300):
        asked.append(clients[chance.choice(words)].call_async(Trigger.Request()))
        asked.append(parameters.call_async(odd_parameters(chance)))
        lab.pause(0.01)
    lab.wait(lambda: sum(future.done() for future in asked) > 100, "answers")
    range_.ask("abort")
    assert range_.process.is_running
    assert range_.driver.is_running
    range_.rests()
    range_.begin()
    first, second = range_.ask("diagnose"), range_.ask("identify")
    assert first.message.startswith("busy")
    assert second.message.startswith("busy")
    assert range_.ask("abort").success
    range_.rests()
    range_.readable()
    range_.log.check()
    assert np.isfinite(range_.samples.displacement).all()
