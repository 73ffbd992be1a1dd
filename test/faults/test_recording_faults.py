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

from piezo_hysteresis.nodes.conversions import values_of
from piezo_hysteresis.nodes.quality import LATCHED
from piezo_hysteresis.recording import read

pytestmark = pytest.mark.nodes

NODE = "identification_node"
PERIOD = 1e-4
ENOUGH = 1 << 20
"""Bytes after which the disk is full."""


class Identification:
    """An identification node and what it tells."""

    def __init__(self, lab, root):
        self.lab, self.statuses = lab, lab.listen(DiagnosticStatus, "status", LATCHED)
        self.process = lab.start(NODE, experiment_root=str(root))
        lab.wait(lambda: self.ask("plan").success, "the driver's limits")

    def ask(self, name):
        return self.lab.call(Trigger, f"{NODE}/{name}")

    def await_state(self, *states):
        def reached():
            return self.statuses and values_of(self.statuses[-1])["state"] in states

        self.lab.wait(reached, f"state {' or '.join(states)}, not {self.statuses[-1:]}")
        return self.statuses[-1]

    def limit(self, size):
        """Files of the node may not grow beyond so many bytes from now on."""
        _, hard = resource.prlimit(self.process.pid, resource.RLIMIT_FSIZE)
        resource.prlimit(self.process.pid, resource.RLIMIT_FSIZE, (size, hard))


@pytest.fixture
def driven(lab):
    lab.driver(sample_period=PERIOD)
    return lab, lab.streaming()


def test_a_full_disk_ends_the_run_and_not_the_node(driven, tmp_path):
    lab, samples = driven
    identification = Identification(lab, tmp_path / "runs")
    identification.limit(ENOUGH)
    assert identification.ask("identify").success
    assert "File too large" in identification.await_state("failed").message
    lab.wait(lambda: all((b.voltage < 1e-3).all() for b in samples.blocks[-50:]), "the safe voltage")
    path = max((tmp_path / "runs").iterdir())
    kept = sum(record.size for record in read(path, include=("idle", "hold")))
    assert kept * 32 > ENOUGH / 4
    identification.limit(resource.RLIM_INFINITY)
    assert identification.ask("identify").success
    identification.await_state("running")
    assert identification.ask("abort").success
    assert read(max((tmp_path / "runs").iterdir()), include=("idle", "hold")).records


def test_where_nothing_may_be_written_nothing_moves(driven):
    lab, samples = driven
    identification = Identification(lab, "/proc/runs")
    assert identification.ask("identify").success
    assert "/proc/runs" in identification.await_state("failed").message
    assert identification.process.is_running
    assert np.ptp(samples.voltage) < 1e-3


def test_parameters_from_outside_choose_no_place(driven, tmp_path):
    lab, _ = driven
    (tmp_path / "runs" / "mine").mkdir(parents=True)
    identification = Identification(lab, tmp_path / "runs")
    asked = {
        ("experiment_root", str(tmp_path)): False,
        ("experiment", "/etc"): False,
        ("experiment", f"{tmp_path}/runs/../../runs"): False,
        ("experiment", f"{tmp_path}/runs/absent"): False,
        ("experiment", f"{tmp_path}/runs/mine"): True,
        ("driver", "another"): False,
    }
    for (name, value), wanted in asked.items():
        request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        answer = lab.call(SetParameters, f"{NODE}/set_parameters", request).results[0]
        assert answer.successful is wanted, (name, value, answer.reason)
    assert identification.process.is_running


def test_killed_while_it_fits_it_takes_the_fit_along_and_starts_again(driven, tmp_path):
    lab, _ = driven
    identification = Identification(lab, tmp_path / "runs")
    assert identification.ask("identify").success
    identification.await_state("running")
    recording = max((tmp_path / "runs").iterdir())
    assert identification.ask("abort").success
    identification.await_state("aborted")
    request = SetParameters.Request(parameters=[Parameter("experiment", value=str(recording)).to_parameter_msg()])
    assert lab.call(SetParameters, f"{NODE}/set_parameters", request).results[0].successful
    assert identification.ask("diagnose").success
    lab.wait(lambda: children(identification.process.pid), "the process of the fit")
    fits = children(identification.process.pid)
    identification.process.signal(signal.SIGKILL)
    identification.process.wait()
    lab.wait(lambda: not any(alive(fit) for fit in fits), "the end of the fit")
    again = Identification(lab, tmp_path / "runs")
    assert again.ask("identify").success
    again.await_state("running")


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
