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

"""The compensation node and a real driver: the stage goes where it was sent, or nothing moves."""

import itertools
import signal
import sys
from dataclasses import replace

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float64, String
from std_srvs.srv import Trigger

from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.model.model_file import dumps, save
from piezo_hysteresis.nodes.messages.cloud import to_cloud
from piezo_hysteresis.nodes.messages.conversions import command_to_cloud, values_of
from piezo_hysteresis.nodes.runtime.qos import LATCHED, STATUS
from piezo_hysteresis.stage.plant import PlantParameters

pytestmark = pytest.mark.nodes

NODE = "compensation_node"
PERIOD = 1e-4
DRIVER = {"sample_period": PERIOD, "block_duration": 0.02, "simulated__seed": 1, "max_slew_rate": 5000.0}
PLANT = PlantParameters()
NOISE = PLANT.sensor.noise * PLANT.full_stroke
STROKE = PLANT.full_stroke
# at 10 kHz the dynamics of the stage of the paper are about one sample of delay
MODEL = Model(
    (BoucWen(), Arx(b=[0.9 * 0.24641, 0.1 * 0.24641], delay=1)), PERIOD, 10.0, 1e-4, {"free_run_error": "5e-08"}
)


class Compensation:
    """A driver, a compensation node, and its status."""

    def __init__(self, lab, known=MODEL, driver=None, **parameters):
        self.lab = lab
        self.statuses = lab.listen(DiagnosticStatus, "status", STATUS)
        if driver is not False:  # there is one already
            self.driver = lab.driver(**(driver or {**DRIVER, "real_time_factor": 1.0}))
        self.samples = lab.streaming()
        model = str(save(known, lab.folder / "model.yaml")) if known is not None else ""
        self.process = lab.start(NODE, **{"model_file": model, "approach": 0.05, **parameters})
        self.trajectory = lab.publisher(PointCloud2, "trajectory")
        lab.wait(self._is_ready, "the node to find the driver")

    def _is_ready(self):
        self.send(np.full(3, np.nan), "ready")
        self.lab.pause(0.3)
        return self.statuses and any(text in self.statuses[-1].message for text in ("expected finite", "no model"))

    def send(self, wanted, phase="scan", period=PERIOD):
        wanted = np.asarray(wanted, dtype=np.float64)
        columns = {"time": period * np.arange(wanted.size), "displacement": wanted}
        stamp = self.lab.node.get_clock().now().to_msg()
        self.trajectory.publish(to_cloud(columns, {"time": "f8", "displacement": "f8"}, stamp, phase))

    def until(self, phase, *states):
        """The status of a phase, once it is in one of the states."""

        def reached():
            found = [s for s in list(self.statuses) if values_of(s)["phase"] == phase]
            return next((s for s in found if values_of(s)["state"] in states), None)

        return self.lab.wait(reached, f"{phase} to be {' or '.join(states)}")

    def ask(self, name):
        return self.lab.call(Trigger, f"{NODE}/{name}")


def scan(low=0.2, high=0.7, frequency=5.0, duration=0.6):
    """Swings between shares of the stroke [m]."""
    t = PERIOD * np.arange(round(duration / PERIOD))
    return STROKE * (low + (high - low) * 0.5 * (1.0 - np.cos(2 * np.pi * frequency * t)))


def test_a_node_with_a_model_file_does_not_wait_for_a_model(lab):
    statuses = lab.listen(DiagnosticStatus, "status", STATUS)
    lab.start(NODE, model_file=str(save(MODEL, lab.folder / "model.yaml")))
    lab.wait(lambda: statuses, "the first status")
    assert statuses[0].message == "nothing was asked for since the start"


def test_the_stage_follows_a_trajectory_and_learning_makes_it_better(lab):
    wrong = MODEL.with_values({"bouc_wen.p2": 1.05 * MODEL.values()["bouc_wen.p2"]})
    node = Compensation(lab, wrong, sensor_noise=NOISE)
    errors, rms = lab.listen(Float64, "tracking_error"), lab.listen(Float64, "tracking_rms")
    wanted = scan()
    node.send(wanted)
    done = values_of(node.until("scan", "done"))
    assert 0.005 * STROKE < float(done["rms"]) < 0.05 * STROKE, "5 % of slope are missing in the model"
    # they come on topics of their own, so a busy test hears "done" before the last of them
    lab.wait(lambda: rms and abs(rms[-1].data / float(done["rms"]) - 1.0) < 0.5, "tracking_rms of the whole path")
    lab.wait(lambda: errors, "tracking_error")
    assert abs(errors[-1].data) < 0.1 * STROKE
    answer = node.ask("plan")
    assert answer.success and "expected error" in answer.message and "V/s" in answer.message
    before = len(node.statuses)
    assert node.ask("learn").success
    learned = lab.wait(
        lambda: next((s for s in node.statuses[before:] if values_of(s)["state"] == "done"), None), "learning to end"
    )
    assert float(values_of(learned)["best"]) < 0.2 * float(done["rms"])
    assert float(values_of(learned)["best"]) < 3.0 * NOISE
    assert node.samples.steepest(PERIOD) <= DRIVER["max_slew_rate"] * 1.001
    assert node.samples.voltage.min() >= 0.0 and node.samples.voltage.max() <= 10.0


def test_an_unreachable_trajectory_is_refused_and_nothing_moves(lab):
    node = Compensation(lab, longest_trajectory=2.0)
    first = node.samples.newest.voltage[-1]
    for phase, wanted, period, reason in (
        ("gap", np.append(scan(), np.nan), PERIOD, "expected finite"),
        ("slow", scan(), 2 * PERIOD, "period"),
        ("long", np.zeros(30_000), PERIOD, "longest_trajectory"),
        ("high", scan(0.2, 1.6), PERIOD, "not reachable"),
        ("low", scan(0.0, 0.7), PERIOD, "voltage_min"),
    ):
        node.send(wanted, phase, period)
        assert reason in node.until(phase, "refused").message
    lab.pause(0.2)
    assert np.ptp(node.samples.voltage) < 1e-3 and node.samples.newest.voltage[-1] == first
    assert not node.ask("plan").success, "the last one that was planned is out of reach"


def test_a_displacement_is_set_and_a_slow_integral_removes_the_remaining_error(lab):
    node = Compensation(lab, integral_time=0.3)
    target = 0.4 * STROKE
    publisher = lab.publisher(Float64, "set_displacement")
    publisher.publish(Float64(data=target))
    node.until("set_displacement", "set")

    def settled():
        block = node.samples.newest
        return abs(float(np.mean(block.displacement)) - target) < 0.001 * STROKE

    lab.wait(settled, "the displacement that was set")
    publisher.publish(Float64(data=5.0 * STROKE))
    assert "not reachable" in node.until("set_displacement", "refused").message
    assert node.ask("stop").success
    assert "goes to its safe voltage" in node.until("set_displacement", "stopped").message


@pytest.mark.parametrize("end", ["stop", pytest.param("cancel", marks=pytest.mark.soak), "kill"])
def test_a_hold_that_the_driver_ended_is_not_resumed(lab, end):
    node = Compensation(lab, integral_time=0.3)
    publisher, sent = lab.publisher(Float64, "set_displacement"), lab.listen(Float64, "set_voltage")
    publisher.publish(Float64(data=0.4 * STROKE))
    lab.wait(lambda: node.samples.newest.voltage[-1] > 2.0 and len(sent) > 10, "the hold")
    if end == "kill":
        node.driver.signal(signal.SIGKILL)
        node.driver.wait()
        lab.driver(**DRIVER, real_time_factor=1.0)
    else:
        assert lab.call(Trigger, f"driver_node/{end}").success
    assert "nothing is held any more: " in node.until("set_displacement", "stopped").message
    if end == "stop":
        assert lab.call(Trigger, "driver_node/release").success
    before = len(sent)
    lab.wait(lambda: abs(node.samples.newest.voltage[-1]) < 1e-3, "the safe voltage")
    lab.pause(1.0)
    assert len(sent) == before and abs(node.samples.newest.voltage[-1]) < 1e-3


def test_the_first_path_after_the_driver_was_killed_is_played_by_the_next_one(lab):
    """It was sent before the new driver had found this node, to the killed one, which is still listed."""
    node = Compensation(lab)
    node.driver.signal(signal.SIGKILL)
    node.driver.wait()
    lab.driver(**DRIVER, real_time_factor=1.0)
    for number in itertools.count():
        node.send(scan(), f"path_{number}")
        ended = node.until(f"path_{number}", "done", "refused", "failed")
        if values_of(ended)["state"] != "refused":  # until its limits are known
            break
        lab.pause(0.3)
    assert values_of(ended)["state"] == "done", ended.message
    assert node.samples.voltage.max() > 1.0


def test_displacements_in_quick_succession_end_at_the_last_one(lab):
    """The stage has gone further than was known when the last voltage was computed, and is in another loop."""
    node = Compensation(lab, driver={**DRIVER, "real_time_factor": 1.0, "ramp_rate": 15.0})
    publisher = lab.publisher(Float64, "set_displacement")
    publisher.publish(Float64(data=0.8 * STROKE))
    node.until("set_displacement", "set")
    lab.pause(0.3)
    publisher.publish(Float64(data=0.3 * STROKE))
    lab.pause(0.1)
    lab.wait(lambda: np.ptp(node.samples.voltage[-5000:]) < 0.01, "half a second of rest")
    assert abs(float(np.mean(node.samples.newest.displacement)) - 0.3 * STROKE) < 0.001 * STROKE


def test_a_displacement_that_the_driver_refuses_is_not_said_to_be_held(lab):
    """Another client's command was playing, and "set" stood for ever where nothing had moved."""
    node = Compensation(lab, integral_time=0.3)
    command = lab.publisher(PointCloud2, "command")
    command.publish(command_to_cloud(np.zeros(20_000), PERIOD, "rest"))
    lab.pause(0.5)
    lab.publisher(Float64, "set_displacement").publish(Float64(data=0.4 * STROKE))
    assert (
        "the driver refused: set_voltage: 'rest' is being played" in node.until("set_displacement", "stopped").message
    )


@pytest.mark.parametrize("metres", [10.0, -1.0])
def test_a_displacement_in_micrometres_is_refused(lab, metres):
    """The tolerance of the check was a share of the path that was asked for, and the stage went to its limit."""
    node = Compensation(lab)
    lab.publisher(Float64, "set_displacement").publish(Float64(data=metres))
    assert "not reachable" in node.until("set_displacement", "refused").message
    lab.pause(0.3)
    assert np.ptp(node.samples.voltage) < 1e-3


def test_nothing_moves_while_play_is_false(lab):
    node = Compensation(lab, play=False)
    node.send(scan())
    node.until("scan", "planned")
    lab.publisher(Float64, "set_displacement").publish(Float64(data=0.4 * STROKE))
    assert "'play' is false" in node.until("set_displacement", "refused").message
    answer = node.ask("learn")
    assert not answer.success and "'play' is false" in answer.message
    lab.pause(0.5)
    assert np.ptp(node.samples.voltage) < 1e-3


def test_stop_takes_the_stage_to_its_safe_voltage(lab):
    node = Compensation(lab)
    node.send(scan(duration=5.0))
    node.until("scan", "playing")
    lab.wait(lambda: node.samples.newest.voltage[-1] > 1.0, "the scan to begin")
    assert node.ask("stop").success
    lab.wait(lambda: abs(node.samples.newest.voltage[-1]) < 1e-3, "the safe voltage")
    node.until("scan", "stopped")


def test_a_path_that_fails_while_it_is_played_leaves_the_stage_safe(lab):
    """After an error of the node the driver played on, and nobody compared what the stage did with the path."""
    code = (
        "import sys; from piezo_hysteresis.nodes.compensation import path_runs; "
        "left = iter(range(40, -1, -1)); path_runs.WaitLimit.has_passed = lambda limit: 1 // next(left) > 1; "
        "from piezo_hysteresis.nodes.compensation.compensation_node import main; sys.exit(main())"
    )
    node, statuses = Compensation(lab, program=[sys.executable, "-c", code], fresh=True), lab.statuses()
    node.send(scan(duration=20.0))
    lab.wait(lambda: node.samples.newest.voltage[-1] > 1.0, "the scan to begin")
    assert "the driver goes to its safe voltage" in node.until("scan", "failed").message
    lab.wait(lambda: "stopped" in lab.states(statuses, "scan"), "the end of the drive")
    lab.wait(lambda: abs(node.samples.newest.voltage[-1]) < 1e-3, "the safe voltage")


def test_a_path_that_the_driver_refuses_does_not_stop_what_another_program_plays(lab):
    node, statuses = Compensation(lab), lab.statuses()
    lab.send(np.zeros(30_000), "foreign", PERIOD)
    lab.wait(lambda: "playing" in lab.states(statuses, "foreign"), "the foreign waveform")
    node.send(scan())
    assert "'foreign' is being played" in node.until("scan", "refused").message
    lab.wait(lambda: {"done", "stopped"} & {*lab.states(statuses, "foreign")}, "its end")
    assert "stopped" not in lab.states(statuses, "foreign")


@pytest.mark.parametrize("drives", ["a path", "a displacement that is held"])
def test_its_end_leaves_the_stage_safe(lab, drives):
    node = Compensation(lab)
    if drives == "a path":
        node.send(scan(duration=5.0))
    else:
        lab.publisher(Float64, "set_displacement").publish(Float64(data=0.5 * STROKE))
    lab.wait(lambda: node.samples.newest.voltage[-1] > 1.0, "motion")
    node.process.signal(signal.SIGTERM)
    assert node.process.wait() == 0
    lab.wait(lambda: abs(node.samples.newest.voltage[-1]) < 1e-3, "the safe voltage")


def test_a_new_model_takes_effect_between_trajectories(lab):
    node = Compensation(lab)
    models = lab.publisher(String, "model", LATCHED)
    node.send(scan(duration=1.0), "first")
    node.until("first", "playing")
    doubled = MODEL.with_values({"arx.b[0]": 2.0 * MODEL.values()["arx.b[0]"]})
    models.publish(String(data=dumps(doubled)))
    done = values_of(node.until("first", "done"))
    assert float(done["rms"]) < 0.004 * STROKE, "linear gain would leave some per cent"
    lab.pause(0.5)  # the new model takes over with the next block
    node.send(scan(0.3, 0.5), "second")
    second = values_of(node.until("second", "done"))
    assert float(second["rms"]) > 0.02 * STROKE, "the model of twice the gain was followed"
    models.publish(String(data=dumps(replace(doubled, sample_period=2.0 * PERIOD))))
    assert "identify at the rate of the driver" in node.until("model", "refused").message
    node.send(scan(0.3, 0.5), "third")
    third = values_of(node.until("third", "done"))
    assert float(third["rms"]) == pytest.approx(float(second["rms"]), rel=0.1), "the refused model replaces none"


def test_a_path_begins_in_the_loop_that_was_driven_before_the_model_came(lab):
    node = Compensation(lab, None)
    statuses, models = lab.statuses(), lab.publisher(String, "model", LATCHED)
    up_and_half_way_down = 4.0 * (1.0 - np.cos(2.0 * np.pi * 2.0 * PERIOD * np.arange(3750)))
    lab.send(np.append(up_and_half_way_down, np.full(500, up_and_half_way_down[-1])), "loop", PERIOD)
    lab.wait(lambda: "done" in lab.states(statuses, "loop"), "the loop")
    models.publish(String(data=dumps(MODEL)))
    lab.pause(0.5)
    wanted = np.full(100, float(np.mean(node.samples.newest.displacement)))
    settled = MODEL.run([4.0], MODEL.rest(4.0))[0][0]
    assert abs(settled - wanted[0]) > 0.02 * STROKE, "at rest at this voltage the stage would be elsewhere"
    node.send(wanted)
    assert float(values_of(node.until("scan", "done"))["rms"]) < 0.004 * STROKE


def test_the_expected_error_is_in_doubt_where_the_loop_is_unknown(lab):
    lab.driver(**DRIVER, real_time_factor=1.0)
    samples, statuses = lab.streaming(), lab.statuses()
    lab.send(5.0 * (1.0 - np.cos(4.0 * np.pi * PERIOD * np.arange(3750))), "loop", PERIOD)
    lab.wait(lambda: "done" in lab.states(statuses, "loop"), "the loop")
    node = Compensation(lab, driver=False)
    node.send(scan(0.4, 0.6), "late")
    late = node.until("late", "done")
    assert float(values_of(late)["rms"]) > 2.0 * float(values_of(late)["expected"])
    assert "driven before its voltages were received" in late.message
    for phase in ("wide", "known"):
        node.send(scan(0.3, 0.9, duration=1.0), phase)
        known = node.until(phase, "done")
    assert "driven before" not in known.message
    assert float(values_of(known)["rms"]) < float(values_of(known)["expected"])
    assert samples.lost == 0


def test_learning_claims_the_stage_and_leaves_it_safe(lab):
    node = Compensation(lab, MODEL.with_values({"bouc_wen.p2": 1.05 * MODEL.values()["bouc_wen.p2"]}), way_back=0.1)
    statuses, holders = lab.statuses(), lab.listen(String, "claimed_by", LATCHED)
    node.send(scan())
    node.until("scan", "done")
    lab.wait(lambda: abs(node.samples.newest.voltage[-1]) < 1e-3, "the way back")
    before = len(node.statuses)
    assert node.ask("learn").success
    node.until("scan_0", "playing")
    lab.send(np.zeros(10), "other", PERIOD)
    lab.wait(lambda: "refused" in lab.states(statuses, "other"), "the refusal of another one's command")
    assert any("claimed by compensation_node" in s.message for s in list(statuses) if s.name == "other")
    ended = lab.wait(
        lambda: [s for s in node.statuses[before:] if values_of(s)["state"] in ("done", "failed")], "learning to end"
    )
    assert values_of(ended[0])["state"] == "done", ended[0].message
    rounds = [values_of(s) for s in list(node.statuses) if values_of(s)["state"] == "learning"]
    assert len(rounds) > 1
    last = int(rounds[-1]["first_index"]) + scan().size
    lab.wait(lambda: node.samples.newest.index[-1] >= last, "the samples of the last round")
    samples = node.samples.so_far()
    for values in rounds:
        at = samples.place() - int(values["first_index"])
        inside = (at >= 0) & (at < scan().size)
        error = samples.displacement[inside] - scan()[at[inside]]
        assert np.sqrt(np.mean(error**2)) == pytest.approx(float(values["rms"]), rel=1e-3)
    lab.wait(lambda: holders[-1].data == "", "the end of the claim")
    lab.wait(lambda: abs(node.samples.newest.voltage[-1]) < 1e-3, "the safe voltage")


def test_learning_again_corrects_the_same_path_and_says_what_it_expects(lab):
    """The path of the second learning was the corrected one of the first, which the stage does not have to follow."""
    wrong = MODEL.with_values({"bouc_wen.p2": 1.05 * MODEL.values()["bouc_wen.p2"]})
    node = Compensation(lab, wrong, way_back=0.1, learning_rounds=1, sensor_noise=1e-12)
    rms = lab.listen(Float64, "tracking_rms")
    node.send(scan())
    node.until("scan", "done")
    for _ in range(2):
        before = len(node.statuses)
        assert node.ask("learn").success
        lab.wait(
            lambda since=before: [s for s in node.statuses[since:] if values_of(s)["state"] in ("done", "failed")],
            "learning to end",
        )
        rounds = {
            state: [v for v in map(values_of, node.statuses[before:]) if v["state"] == state]
            for state in ("playing", "learning")
        }
        assert [v["expected"] for v in rounds["playing"]] == [v["expected"] for v in rounds["learning"]]
        last = int(rounds["learning"][-1]["first_index"]) + scan().size
        lab.wait(lambda end=last: node.samples.newest.index[-1] >= end, "the samples of the last round")
        samples = node.samples.so_far()
        for values in rounds["learning"]:
            at = samples.place() - int(values["first_index"])
            inside = (at >= 0) & (at < scan().size)
            error = samples.displacement[inside] - scan()[at[inside]]
            assert np.sqrt(np.mean(error**2)) == pytest.approx(float(values["rms"]), rel=1e-3)
        assert rms[-1].data == pytest.approx(float(rounds["learning"][-1]["rms"]), rel=0.2)


def test_its_end_leaves_alone_what_another_program_plays(lab):
    node = Compensation(lab)
    lab.send(np.concatenate((np.linspace(0.0, 2.0, 1000), np.full(60_000, 2.0))), "foreign", PERIOD)
    lab.wait(lambda: node.samples.newest.voltage[-1] == pytest.approx(2.0, abs=1e-3), "the foreign waveform")
    node.send(scan(duration=100.0), "planned_for_seconds")
    node.until("planned_for_seconds", "planning")
    node.process.signal(signal.SIGTERM)
    assert node.process.wait() == 0
    lab.pause(0.3)
    assert node.samples.newest.voltage[-1] == pytest.approx(2.0, abs=1e-3)


def test_a_stage_claimed_by_another_program_is_refused_with_the_reason(lab):
    node = Compensation(lab)
    holders = lab.listen(String, "claimed_by", LATCHED)
    lab.publisher(KeyValue, "claim").publish(KeyValue(key="another_lab", value="claim"))
    lab.wait(lambda: holders and holders[-1].data == "another_lab", "the claim")
    lab.pause(0.2)
    node.send(scan())
    assert "claimed by another_lab" in node.until("scan", "refused").message
    assert not node.ask("learn").success


def test_a_path_begins_where_a_moving_stage_has_come_to_rest(lab):
    node = Compensation(lab, driver={**DRIVER, "real_time_factor": 1.0, "ramp_rate": 4.0})
    lab.publisher(Float64, "set_voltage").publish(Float64(data=6.0))
    lab.wait(lambda: node.samples.newest.voltage[-1] > 1.0, "motion")
    node.send(scan(), "later")
    node.until("later", "done")
    assert node.samples.steepest(PERIOD) * PERIOD <= 0.01 * 10.0 + 0.01, "no jump to where the stage had been"
