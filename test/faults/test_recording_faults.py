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

"""The identification node when the disk is full, when it may not write, and when it is killed."""

import resource
import shutil
import signal
import subprocess
from contextlib import contextmanager

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

from .campaign import children

pytestmark = pytest.mark.nodes

NODE = "identification_node"
PERIOD = 1e-4
ENOUGH = 1 << 20
"""Bytes after which the disk is full."""


class Identification:
    """An identification node and its status."""

    def __init__(self, lab, root):
        self.lab, self.root, self.statuses = lab, root, lab.listen(DiagnosticStatus, "status", LATCHED)
        self._goal = ""
        root.mkdir(exist_ok=True)
        self.process = lab.start(NODE, experiment_root=str(root))
        lab.wait(lambda: self.ask("plan").success, "the driver's limits")

    def ask(self, name):
        answer = self.lab.call(Trigger, f"{NODE}/{name}")
        if "; goal " in answer.message:
            self._goal = answer.message.rpartition("; goal ")[2]
        return answer

    def await_state(self, *states):
        """The last status of what was begun last, once it is one of `states`."""

        def reached():
            values = values_of(self.statuses[-1]) if self.statuses else {}
            return values.get("goal") == self._goal and values["state"] in states

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


def test_without_a_writable_folder_nothing_moves(running):
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


def deleted(folder):
    shutil.rmtree(folder)


def moved(folder):
    folder.rename(folder.parent.with_name(f"moved_{folder.name}"))


def replaced(folder):
    """The file of the bag is another one of the same name."""
    (file,) = folder.glob("*.mcap")
    file.unlink()
    file.touch()


@pytest.mark.parametrize("lose", [deleted, moved, replaced])
def test_a_recording_that_is_lost_ends_the_run_within_a_second_of_samples(running, lose):
    lab, samples, identification = running
    at_rest(lab, samples)
    assert identification.ask("identify").success
    identification.await_state("running")
    lab.wait(lambda: samples.newest.voltage[-1] > 1.0, "motion")
    statuses = lab.statuses()
    lose(identification.newest())
    end = samples.newest.index[-1] + 1.5 / PERIOD
    reported = identification.await_state("failed").message
    assert "deleted or moved" in reported
    lab.wait(lambda: statuses and values_of(statuses[-1])["state"] == "stopped", "the stop of the driver")
    lab.wait(lambda: samples.newest.index[-1] > end, "the samples after it")
    heard = samples.so_far()
    inside = heard.index <= end
    assert heard.voltage[inside][-1] < heard.voltage[inside].max(), "on its way to the safe voltage"
    at_rest(lab, samples)
    assert identification.process.is_running
    assert not identification.ask("abort").success


def test_abort_of_a_run_whose_recording_has_gone_ends_no_node(running):
    """Abort at once, before the recorder itself has noticed."""
    lab, samples, identification = running
    for _ in range(3):
        at_rest(lab, samples)
        assert identification.ask("identify").success
        identification.await_state("running")
        lab.wait(lambda: samples.newest.voltage[-1] > 1.0, "motion")
        client = lab.node.create_client(Trigger, f"{NODE}/abort")
        lab.wait(client.service_is_ready, "the service")
        lab.pause(0.1)
        deleted(identification.newest())
        lab.wait(client.call_async(Trigger.Request()).done, "an answer")
        reported = identification.await_state("aborted", "failed").message
        assert "deleted or moved" in reported or "No such file" in reported
    at_rest(lab, samples)
    assert identification.process.is_running


def run(*command):
    """Do something that only some machines and users can."""
    try:
        done = subprocess.run(command, capture_output=True, text=True)
    except FileNotFoundError as error:
        pytest.skip(f"no file system can be made here: {error}")
    if done.returncode:
        pytest.skip(f"no file system can be mounted here: {' '.join(command)}: {done.stderr.strip()}")


@contextmanager
def temporary_disk(root, options):
    """A file system of its own in memory."""
    run("mount", "-t", "tmpfs", "-o", options, "tmpfs", str(root))
    try:
        yield
    finally:
        subprocess.run(["umount", "--lazy", str(root)], check=True)


@contextmanager
def disk_with_quota(root, limit):
    """A btrfs in a file; what is below `root` may hold so much."""
    image = root.with_name("image")
    with image.open("wb") as file:
        file.truncate(128 << 20)
    run("mkfs.btrfs", "--quiet", str(image))
    run("mount", "-o", "loop", str(image), str(root))
    try:
        run("btrfs", "quota", "enable", str(root))
        run("btrfs", "qgroup", "limit", limit, str(root))
        yield
    finally:
        subprocess.run(["umount", "--lazy", str(root)], check=True)
        image.unlink()


@pytest.mark.parametrize(
    ("disk", "option", "reason"),
    [
        (temporary_disk, "size=1m", "No space left on device"),
        (temporary_disk, "nr_inodes=2", "No space left on device"),
        (temporary_disk, "ro", "Read-only file system"),
        (disk_with_quota, "1M", "Disk quota exceeded"),
    ],
    ids=["full", "no more files", "read-only", "quota"],
)
def test_a_real_disk_that_takes_no_more_ends_the_run_and_not_the_node(running, disk, option, reason):
    """A file system of its own, where the machine lets one be mounted: root may write into any folder of another."""
    lab, samples, identification = running
    at_rest(lab, samples)
    with disk(identification.root, option):
        assert identification.ask("identify").success
        assert reason in identification.await_state("failed").message
        at_rest(lab, samples)
        if option in ("size=1m", "1M"):
            assert read(identification.newest(), include=("idle", "hold")).records
        assert identification.process.is_running
    assert identification.ask("identify").success
    identification.await_state("running")
    assert identification.ask("abort").success


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


def alive(pid):
    """True for a process that is neither gone nor only waiting to be taken note of."""
    try:
        with open(f"/proc/{pid}/stat") as stat:
            return stat.read().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
