"""The identification node when the disk is full, when it may not write, and when it is killed."""

import os
import resource
import signal

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from benchmarks.naming_cases import Case
from piezo_hysteresis.nodes.messages.conversions import values_of
from piezo_hysteresis.nodes.runtime.qos import LATCHED
from piezo_hysteresis.recording import read, write

pytestmark = pytest.mark.nodes

NODE = "identification_node"
PERIOD = 1e-4
ENOUGH = 1 << 20
"""Bytes after which the disk is full."""


class Identification:
    """An identification node and what it tells."""

    def __init__(self, lab, root):
        self.lab, self.root, self.statuses = lab, root, lab.listen(DiagnosticStatus, "status", LATCHED)
        root.mkdir(exist_ok=True)
        self.process = lab.start(NODE, experiment_root=str(root))
        lab.wait(lambda: self.ask("plan").success, "the driver's limits")

    def ask(self, name):
        return self.lab.call(Trigger, f"{NODE}/{name}")

    def await_state(self, *states):
        def reached():
            return self.statuses and values_of(self.statuses[-1])["state"] in states

        self.lab.wait(reached, f"state {' or '.join(states)}, not {self.statuses[-1:]}")
        return self.statuses[-1]

    def newest(self):
        """The last recording."""
        return max(self.root.iterdir())

    def limit(self, size):
        """Files of the node may not grow beyond so many bytes from now on."""
        _, hard = resource.prlimit(self.process.pid, resource.RLIMIT_FSIZE)
        resource.prlimit(self.process.pid, resource.RLIMIT_FSIZE, (size, hard))


@pytest.fixture(scope="module")
def running(shared_lab):
    """A driver and an identification node for all tests here."""
    shared_lab.driver(sample_period=PERIOD)
    samples = shared_lab.streaming()
    return shared_lab, samples, Identification(shared_lab, shared_lab.folder / "runs")


def at_rest(lab, samples):
    """Wait for half a second at the safe voltage."""
    begin = len(samples.blocks)
    lab.wait(lambda: len(samples.blocks) > begin + 50, "half a second")
    lab.wait(lambda: all((b.voltage < 1e-3).all() for b in samples.blocks[-50:]), "the safe voltage")


def test_a_full_disk_ends_the_run_and_not_the_node(running):
    lab, samples, identification = running
    identification.limit(ENOUGH)
    assert identification.ask("identify").success
    assert "File too large" in identification.await_state("failed").message
    at_rest(lab, samples)
    kept = sum(record.size for record in read(identification.newest(), include=("idle", "hold")))
    assert kept * 32 > ENOUGH / 4
    identification.limit(resource.RLIM_INFINITY)
    assert identification.ask("identify").success
    identification.await_state("running")
    assert identification.ask("abort").success
    assert read(identification.newest(), include=("idle", "hold")).records


def test_where_nothing_may_be_written_nothing_moves(running):
    """A file where the folder was: also root may not write into it."""
    lab, samples, identification = running
    at_rest(lab, samples)
    identification.root.rename(identification.root.with_name("moved"))
    identification.root.touch()
    begin = len(samples.blocks)
    try:
        assert identification.ask("identify").success
        assert str(identification.root) in identification.await_state("failed").message
    finally:
        identification.root.unlink()
        identification.root.with_name("moved").rename(identification.root)
    lab.wait(lambda: len(samples.blocks) > begin + 20, "blocks after it")
    assert all(np.ptp(block.voltage) < 1e-3 for block in samples.blocks[begin:])


def test_parameters_from_outside_choose_no_place(running):
    lab, _, identification = running
    root = identification.root
    (root / "mine").mkdir()
    asked = {
        ("experiment_root", str(root.parent)): False,
        ("experiment", "/etc"): False,
        ("experiment", f"{root}/../../runs"): False,
        ("experiment", f"{root}/absent"): False,
        ("experiment", f"{root}/mine"): True,
        ("driver", "another"): False,
    }
    for (name, value), wanted in asked.items():
        request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        answer = lab.call(SetParameters, f"{NODE}/set_parameters", request).results[0]
        assert answer.successful is wanted, (name, value, answer.reason)
    (root / "mine").rmdir()


@pytest.mark.soak
def test_killed_while_it_fits_it_takes_the_fit_along_and_starts_again(running, tmp_path):
    lab, _, identification = running
    recording = identification.root / f"0_{tmp_path.name}"  # before all that the node records
    write(Case("poor", ("creep",), 0, 5e-4).experiment(), recording)
    request = SetParameters.Request(parameters=[Parameter("experiment", value=str(recording)).to_parameter_msg()])
    assert lab.call(SetParameters, f"{NODE}/set_parameters", request).results[0].successful
    assert identification.ask("diagnose").success
    lab.wait(lambda: children(identification.process.pid), "the process of the fit")
    fits = children(identification.process.pid)
    identification.process.signal(signal.SIGKILL)
    identification.process.wait()
    lab.wait(lambda: not any(alive(fit) for fit in fits), "the end of the fit")
    again = Identification(lab, identification.root)
    assert again.ask("identify").success
    again.await_state("running")
    assert again.ask("abort").success


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


def alive(pid):
    """True for a process that is neither gone nor only waiting to be taken note of."""
    try:
        with open(f"/proc/{pid}/stat") as stat:
            return stat.read().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
