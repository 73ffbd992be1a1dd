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

"""From an unknown stage to a model that predicts it live; and no way of ending that leaves the stage energised."""

import signal

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from rcl_interfaces.srv import GetParameters, ListParameters, SetParametersAtomically
from rclpy.parameter import Parameter, parameter_value_to_python
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float64, String
from std_srvs.srv import Trigger

from piezo_hysteresis.identification.protocol.drive_limits import DriveLimits
from piezo_hysteresis.identification.protocol.protocol import short
from piezo_hysteresis.model.model_file import dumps, load
from piezo_hysteresis.model.model_parameters import from_parameters, hash_number
from piezo_hysteresis.nodes.identification.bag_recorder import BagRecorder
from piezo_hysteresis.nodes.messages.cloud import from_cloud
from piezo_hysteresis.nodes.messages.conversions import values_of
from piezo_hysteresis.nodes.messages.samples import PREDICTED_SAMPLES
from piezo_hysteresis.nodes.runtime.qos import LATCHED, SAMPLES
from piezo_hysteresis.recording import read
from piezo_hysteresis.report.json_file import read_json
from piezo_hysteresis.stage.plant import PlantParameters

pytestmark = pytest.mark.nodes

NODE = "identification_node"
PERIOD = 1e-4
DRIVER = {"sample_period": PERIOD, "block_duration": 0.02, "simulated__seed": 1}
PLANT = PlantParameters()
NOISE = PLANT.sensor.noise * PLANT.full_stroke


class Identification:
    """An identification node, and its status."""

    def __init__(self, lab, *arguments, **parameters):
        self.lab = lab
        self.statuses = lab.listen(DiagnosticStatus, "status", LATCHED)
        self.runs = lab.folder / "runs"
        self.process = lab.start(NODE, *arguments, experiment_root=str(self.runs), **parameters)

    def ask(self, name):
        return self.lab.call(Trigger, f"{NODE}/{name}")

    def begin(self):
        """Start the protocol and return the folder of the recording once the first phase plays."""
        self.lab.wait(lambda: self.ask("plan").success, "the driver's limits")
        assert self.ask("identify").success
        self.await_state("running")
        return max(self.runs.iterdir())

    def await_state(self, *states, timeout=30.0):
        """The last status, once it is one of `states`."""

        def reached():
            return self.statuses and values_of(self.statuses[-1])["state"] in states

        self.lab.wait(reached, f"state {' or '.join(states)}, not {self.statuses[-1:]}", timeout)
        return self.statuses[-1]

    def served(self):
        """Everything under ``model.``, by name."""
        request = ListParameters.Request(prefixes=["model"])
        names = list(self.lab.call(ListParameters, f"{NODE}/list_parameters", request).result.names)
        answer = self.lab.call(GetParameters, f"{NODE}/get_parameters", GetParameters.Request(names=names))
        return dict(zip(names, map(parameter_value_to_python, answer.values), strict=True))

    def write(self, **values):
        """Outcome of an attempt to set parameters from outside."""
        request = SetParametersAtomically.Request()
        named = {name.replace("__", "."): value for name, value in values.items()}
        request.parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in named.items()]
        return self.lab.call(SetParametersAtomically, f"{NODE}/set_parameters_atomically", request).result


def test_from_an_unknown_stage_to_a_live_model(lab):
    lab.driver(**DRIVER, real_time_factor=2.0)
    lab.start("model_node")
    models, rms = lab.listen(String, "model", LATCHED), lab.listen(Float64, "residual_rms")
    voltage, predicted = lab.listen(Float64, "voltage"), lab.listen(PointCloud2, "predicted_samples", SAMPLES)
    identification = Identification(lab)
    lab.wait(lambda: lab.node.count_subscribers("model") >= 2, "the model node")
    before = identification.served()
    assert before["model.valid"] is False
    protocol = short(DriveLimits(sample_period=PERIOD))
    lab.wait(lambda: identification.ask("plan").success, "the driver's limits")
    plan = identification.ask("plan").message
    assert f"short: {len(protocol)} phases, {protocol.summary.duration:.1f} s, 0 to 10 V, largest slew" in plan

    recorder, commands = BagRecorder(lab.node, lab.folder / "everything"), lab.statuses()
    path = identification.begin()
    assert identification.ask("identify").message.startswith("busy")
    ended = identification.await_state("fitting", "failed", timeout=240.0)
    end = int(values_of(commands[-1])["first_index"]) + protocol.phases[-1].voltage.size
    lab.wait(lambda: recorder.holds(end), "the last samples in the other recording")
    lab.do(recorder.close)
    assert "% of range" in identification.await_state("done", "failed", timeout=240.0).message, ended.message

    model = load(path / "identification.yaml")
    assert dumps(from_parameters(identification.served())) == dumps(model)
    lab.wait(lambda: models, "the model on its topic")
    assert models[-1].data == dumps(model)
    assert float(model.provenance["free_run_error"]) < 1.5 * NOISE
    for outside in (
        {"model__bouc_wen__A": 1.0},
        {"model__valid": False},
        {"seed": 3, "model__hash": "x"},
        {"model__creep__gamma": 0.1},
        {"protocoll": "short"},
        {"protocol": "quick"},
    ):
        assert not identification.write(**outside).successful
    assert dumps(from_parameters(identification.served())) == dumps(model)
    assert identification.write(protocol="paper").successful

    number = hash_number(model)

    def follows():
        return predicted and from_cloud(predicted[-1], PREDICTED_SAMPLES)["model"][-1] == number

    lab.wait(follows, "the model node to follow")
    lab.send(3.5 - 3.5 * np.cos(2 * np.pi * 30 * PERIOD * np.arange(60_000)), "sine_30hz", PERIOD)
    lab.wait(lambda: np.ptp([m.data for m in voltage[-20:]]) > 5.0, "the sine")
    del rms[:]
    lab.wait(lambda: len(rms) >= 200, "four seconds of stage time", 60.0)
    # the first second still holds what was before; a block lost on a busy machine raises the rms for one second only
    assert np.median([message.data for message in rms[50:]]) <= 1.2 * NOISE

    own, everything = read(path, decimate={}), read(lab.folder / "everything")
    assert [r.phase for r in own] == [p.name for p in protocol]
    for one, other in zip(own, everything, strict=True):
        np.testing.assert_array_equal(one.voltage, other.voltage)
        np.testing.assert_array_equal(one.displacement, other.displacement)
    assert not own.notices

    assert identification.ask("diagnose").message.startswith(f"diagnosing {path}; goal ")
    identification.await_state("fitting")
    reported = identification.await_state("done", "failed", timeout=240.0)
    assert reported.message.startswith("nothing_missing: "), reported.message
    assert values_of(reported)["conclusion"] == "nothing_missing"
    assert dumps(load(path / "diagnosis.yaml")) == dumps(from_parameters(identification.served())) == models[-1].data
    answer = read_json(str(path / "answer.json"))
    assert (answer["verdict"], answer["model"]) == ("nothing_missing", str(path / "diagnosis.yaml"))

    again = lab.start(NODE, "--params-file", str(path / "diagnosis.yaml"), namespace="/again")
    resumed = lab.listen(String, "/again/model", LATCHED)
    lab.wait(lambda: resumed, "the model of a node started with it")
    assert resumed[-1].data == models[-1].data
    assert again.is_running


def test_every_early_end_leaves_the_stage_safe_and_the_recording_readable(lab):
    """Abort, a stop at the driver, SIGINT and SIGKILL, each in the middle of a phase, by a node that began badly."""
    identification = Identification(lab, model__effects=["bouc_wen"])
    assert "'model.sample_period' is missing" in identification.await_state("failed").message
    assert "configured 'driver_node'" in lab.wait(lambda: identification.ask("plan"), "an answer").message
    assert identification.ask("identify").success
    assert "driver_node" in identification.await_state("waiting").message
    assert identification.ask("abort").success
    identification.await_state("aborted")
    assert not identification.ask("abort").success

    lab.driver(**DRIVER)
    samples = lab.streaming()

    def moving():
        return samples.newest.voltage[-1] > 4.0

    def recorded(path):
        """The phase that was cut short, and no other; in pieces where a busy computer lost blocks."""
        experiment = read(path)
        assert {record.phase for record in experiment} <= {"conditioning", "hold"}
        records = experiment.named("conditioning")
        assert max(record.voltage.max() for record in records) > 1.0
        return records

    def at_rest():
        lab.wait(lambda: all((b.voltage < 1e-3).all() for b in samples.blocks[-50:]), "half a second of rest")

    path = identification.begin()
    lab.wait(moving, "the first phase")
    assert identification.ask("abort").success
    identification.await_state("aborted")
    at_rest()
    recorded(path)

    path = identification.begin()
    lab.wait(moving, "the first phase")
    assert lab.call(Trigger, "driver_node/stop").success
    assert "stopped" in identification.await_state("failed").message
    at_rest()
    recorded(path)
    refused = identification.ask("identify")
    assert not refused.success
    assert "call driver_node/release first" in refused.message
    assert lab.call(Trigger, "driver_node/release").success
    lab.pause(1.0)  # until the identification node has asked the driver again

    path = identification.begin()
    lab.wait(moving, "the first phase")
    identification.process.signal(signal.SIGINT)
    assert identification.process.wait() == 0
    at_rest()
    recorded(path)

    identification = Identification(lab)
    path = identification.begin()
    lab.wait(moving, "the first phase")
    number = samples.newest.phase[-1]
    heard = samples.so_far()
    began = int(heard.index[heard.phase == number][0])
    size = short(DriveLimits(sample_period=PERIOD)).phases[0].voltage.size
    lab.wait(lambda: samples.newest.index[-1] > began + 0.8 * size, "most of the first phase")
    assert samples.newest.phase[-1] == number
    last = int(samples.newest.index[-1])
    identification.process.signal(signal.SIGKILL)
    lab.wait(lambda: samples.newest.phase[-1] > number, "the end of the phase, which the driver plays whole")
    at_rest()
    records = recorded(path)
    starts = [round((record.start_time - records[0].start_time) / PERIOD) for record in records]
    # half a second is what the recorder keeps in memory, the rest what may be on its way while the computer is busy
    assert starts[-1] + records[-1].size >= last - began - 1.0 / PERIOD
    heard = samples.so_far()
    inside = heard.phase == number
    place, voltage = heard.place()[inside] - began, heard.voltage[inside]
    for start, record in zip(starts, records, strict=True):
        common = (place >= start) & (place < start + record.size)
        np.testing.assert_array_equal(record.voltage[place[common] - start], voltage[common])
