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

"""The driver as a process.

No sample is lost unreported, nothing leaves the limits, and its end leaves the stage safe.
"""

import signal
from pathlib import Path

import numpy as np
import pytest
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter
from std_msgs.msg import Float64

from piezo_hysteresis.acquisition.session import DriverSession
from piezo_hysteresis.errors import StageError
from piezo_hysteresis.nodes.driver.driver_node import DriverNode
from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.recording import write
from piezo_hysteresis.stage import back_ends
from piezo_hysteresis.stage.opening import BackEnd

from ...acquisition.witness import Witness

pytestmark = pytest.mark.nodes

PERIOD = 2e-5
RAMP_RATE = 20.0
IDEAL = {"simulated__electronics__dac_bits": 0.0, "ramp_rate": RAMP_RATE}
"""Without a converter the voltages published are those applied, bit for bit."""


def test_hold_timeout_leads_to_the_safe_voltage(lab):
    lab.driver(**IDEAL, hold_timeout=0.3)
    samples = lab.streaming()
    lab.send(np.linspace(0, 1, 1000), "step")
    lab.wait(lambda: samples.newest.phase[-1] == 2 and samples.newest.voltage[-1] == 0.0, "the way back")
    held = samples.place()[samples.voltage == 1.0]
    assert held[-1] - held[0] == pytest.approx(0.3 / PERIOD, abs=2 + samples.lost)
    assert samples.steepest(PERIOD) <= 1 / (999 * PERIOD) * (1 + 1e-6)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP], ids=lambda number: number.name)
def test_a_signal_ramps_to_the_safe_voltage(lab, number):
    driver = lab.driver(fresh=True, **IDEAL)
    samples = lab.streaming()
    lab.send(np.concatenate((np.linspace(0, 4, 20_000), np.full(500_000, 4.0))), "long")
    lab.wait(lambda: samples.newest.voltage[-1] == 4.0, "the top")
    driver.signal(number)
    assert driver.wait() == 0, driver.output
    lab.wait(lambda: samples.newest.voltage[-1] == 0.0, "the safe voltage")
    assert samples.steepest(PERIOD) <= RAMP_RATE * (1 + 1e-6)


def test_room_for_large_blocks_is_shared_with_nodes_that_have_less(lab):
    profile = Path(__file__).parents[3] / "config" / "large_blocks.xml"
    driver = lab.driver(sample_period=2e-6, environment={"FASTDDS_DEFAULT_PROFILES_FILE": str(profile)})
    samples = lab.streaming()
    lab.wait(lambda: len(samples.blocks) > 3 and samples.newest.size == 5000, "blocks of 500 kHz")
    lines = Path(f"/proc/{driver.pid}/maps").read_text().splitlines()
    ends = [line.split()[0].split("-") for line in lines if "/dev/shm/fastdds_" in line]
    assert max(int(last, 16) - int(first, 16) for first, last in ends) >= 100 * 5000 * 40


def test_deactivate_ramps_down_and_activate_streams_again(lab):
    lab.driver(**IDEAL)
    samples, live = lab.streaming(), lab.listen(Float64, "voltage")
    lab.publisher(Float64, "set_voltage").publish(Float64(data=2.0))
    lab.wait(lambda: samples.newest.voltage[-1] == 2.0 and samples.newest.index[-1] > 100_000, "the set-point")
    streamed = int(samples.newest.index[-1])
    assert lab.transition("deactivate")
    assert lab.state() == "inactive"
    lab.wait(lambda: samples.newest.voltage[-1] == 0.0, "the safe voltage")
    assert samples.steepest(PERIOD) <= RAMP_RATE * (1 + 1e-6)
    blocks = len(samples.blocks)
    assert lab.transition("activate")
    lab.wait(lambda: len(samples.blocks) > blocks + 5, "blocks again")
    live.clear()
    lab.wait(lambda: 20_000 < samples.newest.index[-1] < streamed, "20 000 samples")
    assert len(live) > 5, "the scalars begin with the samples, not where the first acquisition ended"
    assert all(lab.transition(name) for name in ("deactivate", "cleanup", "configure", "activate"))
    blocks = len(samples.blocks)
    lab.wait(lambda: len(samples.blocks) > blocks + 5, "blocks of the stage opened again")


def test_a_killed_driver_can_be_started_again_at_once(lab):
    first = lab.driver(**IDEAL)
    samples = lab.streaming()
    first.signal(signal.SIGKILL)
    first.wait()
    blocks = len(samples.blocks)
    lab.driver(**IDEAL)
    lab.wait(lambda: len(samples.blocks) > blocks + 5, "blocks of the second")


def test_further_signals_do_not_cut_the_ramp(lab):
    driver = lab.driver(**{**IDEAL, "ramp_rate": 4.0})
    samples = lab.streaming()
    lab.send(np.linspace(0, 4, 20_000), "up")
    lab.wait(lambda: samples.newest.voltage[-1] == 4.0, "the top")
    for number in (signal.SIGINT, signal.SIGINT, signal.SIGTERM):
        driver.signal(number)
        lab.wait(lambda top=samples.newest.voltage[-1]: samples.newest.voltage[-1] < top, "the way down")
    assert driver.wait() == 0
    lab.wait(lambda: samples.newest.voltage[-1] == 0.0, "the safe voltage")
    assert samples.steepest(PERIOD) <= 4 / (19_999 * PERIOD) * (1 + 1e-6)


def _set(**values):
    request = SetParametersAtomically.Request()
    request.parameters = [
        Parameter(name.replace("__", "."), value=value).to_parameter_msg() for name, value in values.items()
    ]
    return request


def test_a_failed_configure_gives_why_and_can_be_tried_again(lab):
    driver = lab.driver(stage="replay")
    reported = lab.diagnostics()
    lab.wait(lambda: any(s.level == b"\x02" for a in reported for s in a.status), "an error")
    assert "replay.experiment" in driver.output
    assert lab.state() == "unconfigured"
    assert lab.call(
        SetParametersAtomically, "driver_node/set_parameters_atomically", _set(stage="simulated")
    ).result.successful
    assert lab.transition("configure")
    answer = lab.call(SetParametersAtomically, "driver_node/set_parameters_atomically", _set(ramp_rate=1.0)).result
    assert not answer.successful
    assert "read when the driver is configured" in answer.reason
    answer = lab.call(
        SetParametersAtomically, "driver_node/set_parameters_atomically", _set(in_force__voltage_max=99.0)
    )
    assert not answer.result.successful
    assert answer.result.reason == "in_force.voltage_max is read only; set voltage_max instead"
    for name, advice in (("stopped", "; call ~/stop or ~/release instead"), ("safe_voltage", "")):
        request = _set(**{f"in_force__{name}": True if name == "stopped" else 1.0})
        answer = lab.call(SetParametersAtomically, "driver_node/set_parameters_atomically", request)
        assert answer.result.reason == f"in_force.{name} is read only{advice}"
    assert lab.transition("activate")
    lab.streaming()


def test_a_failing_stage_is_made_safe_reported_and_can_be_tried_again(lab, monkeypatch):
    """In the process of the test, since no real stage fails when asked to."""
    stages = [Witness(1e-3, 100.0, fails_at=5), Witness(1e-3, 100.0)]
    opened = iter(stages)
    monkeypatch.setitem(back_ends.BACK_ENDS, "simulated", BackEnd("simulated", (), lambda *_: next(opened), True))
    reported = lab.diagnostics()
    node = lab.add(DriverNode, discovery_time=0.0, ramp_rate=50.0)
    node.begin()
    lab.wait(lambda: lab.state() == "unconfigured", "the end of the failed stage")
    assert (stages[0].made_safe, stages[0].closed) == (2, 1), "by the acquisition, and when it is deactivated"
    lab.wait(lambda: any("link lost" in s.message for a in reported for s in a.status), "the reason")
    assert lab.transition("configure")
    assert lab.transition("activate")
    lab.streaming()
    assert lab.transition("deactivate")
    assert stages[1].made_safe == 1


def test_a_stage_that_was_not_seen_at_its_safe_voltage_is_not_reported_there(lab, monkeypatch):
    make_safe = DriverSession.make_safe

    def fail(session):
        make_safe(session)
        raise StageError("not at the safe voltage within 2 s")

    node = lab.add(DriverNode, **IDEAL)
    node.begin()
    lab.streaming()
    reported = lab.diagnostics()
    with monkeypatch.context() as patched:
        patched.setattr(DriverSession, "make_safe", fail)
        assert not lab.transition("deactivate")
    assert lab.state() == "unconfigured"
    reported.clear()
    lab.wait(lambda: any("not at the safe voltage" in s.message for a in reported for s in a.status), "the reason")
    assert not any("not active" in s.message for a in reported for s in a.status)


def test_two_axes_do_not_meet(lab):
    for axis in ("/stage_x", "/stage_y"):
        lab.driver(namespace=axis, **IDEAL)
    x, y = lab.streaming("/stage_x/samples"), lab.streaming("/stage_y/samples")
    lab.publisher(Float64, "/stage_y/set_voltage").publish(Float64(data=1.0))
    lab.wait(lambda: y.newest.voltage[-1] == 1.0, "the set-point of y")
    assert not x.voltage.any()


def test_a_recording_is_replayed_sample_by_sample(lab, tmp_path):
    rng = np.random.default_rng(2)
    records = [
        Record(rng.random(37), rng.random(37) * 1e-5, 5e-3, "rest"),
        Record(rng.random(64), rng.random(64) * 1e-5, 5e-3, "triangle", start_time=37 * 5e-3),
    ]
    write(Experiment(tuple(records)), tmp_path / "experiment")
    samples, phases = lab.samples(), lab.phases()
    driver = lab.driver(stage="replay", replay__experiment=str(tmp_path / "experiment"), replay__subscribers=1)
    lab.wait(lambda: samples.blocks and samples.newest.phase[-1] == 3, "the end of the recording")
    assert samples.index[0] == 0
    assert samples.lost == 0
    for number, record in enumerate(records, 1):
        inside = samples.phase == number
        assert np.array_equal(samples.voltage[inside], record.voltage)
        assert np.array_equal(samples.displacement[inside], record.displacement)
    assert [p.data for p in phases][-3:] == ["1 rest", "2 triangle", "3 hold"]
    assert lab.transition("deactivate")
    lab.wait(lambda: "not active any more" in driver.output, "the line of the end")
    assert "safe voltage" not in driver.output


def test_a_stage_with_memory_plays_blocks_and_gives_the_dead_time(lab):
    lab.driver(**IDEAL, simulated__memory=True, simulated__longest_block=10_000, simulated__dead_time=0.02)
    samples, statuses = lab.streaming(), lab.statuses()
    wave = np.sin(np.linspace(0, np.pi, 25_000)) * 5
    lab.send(wave, "sine")
    lab.wait(lambda: "done" in lab.states(statuses, "sine"), "the end of the command")
    lab.wait(lambda: samples.newest.phase[-1] == 2, "the hold after it")
    in_phase = samples.phase == 1
    assert np.array_equal(samples.voltage[in_phase], wave)
    played = [b for b in samples.blocks if b.phase[0] == 1]
    assert [b.size for b in played] == [10_000, 10_000, 5_000]
    assert all(b.follows_gap for b in played)
    gaps = [int(b.index[0]) - int(a.index[-1]) - 1 for a, b in zip(samples.blocks, samples.blocks[1:], strict=False)]
    assert all((gap > 0) == block.follows_gap for gap, block in zip(gaps, samples.blocks[1:], strict=True))
