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

"""The model node of several axes, behind real drivers: one that replays all axes, and one of each axis."""

from dataclasses import replace

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState, PointCloud2
from std_srvs.srv import Trigger

from piezo_hysteresis.acquisition.sample_block import SampleBlock
from piezo_hysteresis.identification.identify_axes import axes_errors, identify_axes
from piezo_hysteresis.model import axes_file
from piezo_hysteresis.model.axes_samples import columns
from piezo_hysteresis.model.model_parameters import first_bits
from piezo_hysteresis.nodes.messages.cloud import from_cloud
from piezo_hysteresis.nodes.messages.conversions import command_to_cloud, values_of
from piezo_hysteresis.nodes.messages.samples import PREDICTED_SAMPLES, samples_from_cloud, samples_to_cloud
from piezo_hysteresis.nodes.runtime.qos import DEEP
from piezo_hysteresis.online.axes_joiner import AxesJoiner
from piezo_hysteresis.online.axes_predictor import AxesPredictor
from piezo_hysteresis.record import Record
from piezo_hysteresis.recording import write

from ...coupled_plant import GAINS, plant

pytestmark = pytest.mark.nodes

FIELDS = PREDICTED_SAMPLES | {
    f"{name}_{n}": "f8" for name in ("displacement", "prediction", "residual") for n in (2, 3)
}
AXES = ("/stage_x", "/stage_y", "/stage_z")


@pytest.fixture(scope="module")
def model():
    return identify_axes([plant(1), plant(2)], length=20)


def reported(reports, what):
    """Statuses of the node whose message contains `what`."""
    statuses = [status for array in list(reports) for status in array.status]
    return [s for s in statuses if s.name.endswith("axes_model_node: prediction") and what in s.message]


def test_one_driver_that_replays_all_axes_is_predicted_bit_for_bit(lab, model, tmp_path):
    record = plant(3)
    write([record], tmp_path / "axes.npz")
    clouds = lab.listen(PointCloud2, "predicted_samples", DEEP)
    live, reports = lab.listen(JointState, "predicted_live"), lab.listen(DiagnosticArray, "/diagnostics", 10)
    lab.start("axes_model_node", model_file=str(axes_file.save(model, tmp_path / "model.npz")))
    lab.wait(lambda: lab.node.count_publishers("predicted_samples") > 0, "the model node")
    lab.driver(stage="replay", replay__experiment=str(tmp_path / "axes.npz"), replay__subscribers=1)
    lab.wait(lambda: clouds and from_cloud(clouds[-1], FIELDS)["index"][-1] >= record.size - 1, "the end of the replay")
    predictor = AxesPredictor(model)
    u, y = columns(record, "voltage"), columns(record, "displacement")
    left = []
    for number, got in enumerate(from_cloud(cloud, FIELDS) for cloud in list(clouds)):
        inside = got["index"] < record.size
        if not inside.all():
            break
        at = got["index"]
        answer = predictor.predict(u[at], y[at], restarted=number == 0)
        names = ("", "_2", "_3")
        for axis, name in enumerate(names):
            assert np.array_equal(got[f"displacement{name}"], y[at, axis])
            assert np.array_equal(got[f"prediction{name}"], answer.prediction[:, axis])
            assert np.array_equal(got[f"residual{name}"], answer.residual[:, axis])
        assert (got["model"] == first_bits(axes_file.content_hash(model))).all()
        assert clouds[number].is_dense != answer.warming_up
        if not answer.warming_up:
            left.append(answer.residual)
    rms = np.concatenate(left).std(axis=0)
    expected = [error.rms for error in axes_errors(model, [record])]
    assert len(left) > 100
    assert rms == pytest.approx(expected, rel=0.3)
    lab.wait(lambda: live, "live values")
    assert list(live[0].name) == [
        "voltage", "voltage_2", "voltage_3", "displacement", "prediction", "residual",
        "prediction_2", "residual_2", "displacement_2", "prediction_3", "residual_3", "displacement_3",
    ]  # fmt: skip
    values = values_of(lab.wait(lambda: reported(reports, ""), "diagnostics")[-1])
    assert {"residual_rms", "residual_rms_2", "residual_rms_3", "drive_rms", "rejoined"} <= values.keys()


def waveform(seed, size=6000):
    """Filtered noise from 0 to 6 V that begins and ends at 0 V."""
    noise = np.random.default_rng(seed).standard_normal(size)
    smooth = np.convolve(noise, np.hanning(40), "same")
    faded = np.clip(3.0 + 1.5 * smooth / smooth.std(), 0.0, 6.0)
    fade = np.minimum(1.0, np.minimum(np.arange(size), np.arange(size)[::-1]) / 400.0)
    return faded * fade


def test_three_drivers_are_one_stage_of_three_axes(lab, tmp_path):
    period = 5e-4
    heard = [lab.listen(PointCloud2, f"{axis}/samples", DEEP) for axis in AXES]
    for seed, axis in enumerate(AXES, 1):
        lab.driver(namespace=axis, sample_period=period, simulated__seed=seed)
    commands = [lab.publisher(PointCloud2, f"{axis}/command") for axis in AXES]

    def drive(first_seed):
        """Play independent noise on all axes, and return when all three have measured it to its end."""
        played = [max((phase_of(cloud) for cloud in seen), default=0) for seen in heard]
        for seed, (axis, command) in enumerate(zip(AXES, commands, strict=True), first_seed):
            command.publish(command_to_cloud(waveform(seed), period, f"noise_{axis[-1]}"))
        for seen, before in zip(heard, played, strict=True):
            lab.wait(lambda s=seen, b=before: any(phase_of(c) > b and has_ended(c) for c in list(s)), "the noise")

    def phase_of(cloud):
        return samples_from_cloud(cloud).phase[-1]

    def has_ended(cloud):
        block = samples_from_cloud(cloud)
        return block.voltage[-1] == 0.0 and np.ptp(block.voltage) == 0.0

    drive(1)
    joiner = AxesJoiner(3, period)
    joined = []
    for number in range(max(map(len, heard))):
        for stream, seen in enumerate(heard):
            if number < len(seen):
                joiner.add(stream, samples_from_cloud(seen[number]))
        joined += joiner.take()
    assert not any(one.missing for one in joined)
    u, y = (
        np.concatenate([np.stack([getattr(b, q) for b in one.blocks], axis=1) for one in joined])
        for q in ("voltage", "displacement")
    )
    others = {f"{q}_{n}": a[:, n - 1] for q, a in (("voltage", u), ("displacement", y)) for n in (2, 3)}
    record = Record(u[:, 0], y[:, 0], period, "noise", truncated=True, channels=others)
    found = identify_axes([record], length=40)
    predicted = [lab.listen(PointCloud2, f"{axis}/predicted_samples", DEEP) for axis in AXES]
    reports = lab.listen(DiagnosticArray, "/diagnostics", 10)
    file = axes_file.save(found, tmp_path / "model.npz")
    lab.start("axes_model_node", axes=", ".join(AXES), model_file=str(file))
    for seen in predicted:
        lab.wait(lambda seen=seen: seen, "predictions")
    assert not predicted[0][0].is_dense
    drive(4)
    for axis, seen, cloud_of in zip(AXES, predicted, heard, strict=True):
        fields = [from_cloud(cloud, PREDICTED_SAMPLES) for cloud in list(seen) if cloud.is_dense]
        residual, measured = (np.concatenate([f[name] for f in fields]) for name in ("residual", "displacement"))
        assert residual.std() < 0.03 * np.ptp(measured), axis
        assert cloud_of[0].header.frame_id == seen[0].header.frame_id == axis.strip("/")
    assert values_of(lab.wait(lambda: reported(reports, "predicting"), "diagnostics")[-1])["lost"] == "0"


def test_a_wrong_file_a_missing_axis_and_other_numbers_are_told_and_the_node_runs_on(lab, model, tmp_path):
    reports = lab.listen(DiagnosticArray, "/diagnostics", 10)
    lab.start("axes_model_node", axes="/stage_x,/stage_y", model_file=str(tmp_path / "absent.npz"))
    refusal = lab.wait(lambda: reported(reports, "absent.npz: No such file"), "the missing file")[-1]
    assert "no samples" in refusal.message
    assert refusal.level == DiagnosticStatus.ERROR

    def written(path):
        parameter = Parameter("model_file", value=str(path)).to_parameter_msg()
        request = SetParametersAtomically.Request(parameters=[parameter])
        return lab.call(SetParametersAtomically, "axes_model_node/set_parameters_atomically", request).result

    (tmp_path / "one.yaml").write_text("/**: {}")
    assert "expected a model of several axes" in written(tmp_path / "one.yaml").reason
    assert written(axes_file.save(model, tmp_path / "model.npz")).successful
    lab.wait(lambda: reported(reports, "no samples of /stage_x, /stage_y"), "the silent drivers")
    lab.driver(namespace="/stage_x", sample_period=1e-3)

    def of_one():
        return [s for s in reported(reports, "no samples of /stage_y") if "/stage_x" not in s.message]

    status = lab.wait(of_one, "the driver that is still silent")[0]
    assert status.level == DiagnosticStatus.STALE
    lab.driver(namespace="/stage_y", sample_period=1e-3)
    lab.wait(
        lambda: reported(reports, "got 2 drives and 2 displacements of all axes, expected 3 and 3"), "the missing axis"
    )
    assert not reported(reports, "set the clocks"), "the clocks are not the reason"
    assert "expected 3 and 3 as the model has" in written(tmp_path / "model.npz").reason
    two = identify_axes([plant(seed, gains=GAINS[:2, :2]) for seed in (1, 2)], length=5)
    slow = written(axes_file.save(replace(two, sample_period=2e-3), tmp_path / "slow.npz"))
    assert slow.reason == "got the sample period 0.001 s, expected 0.002 s as the model has"
    assert written(axes_file.save(two, tmp_path / "two.npz")).successful
    lab.wait(lambda: values_of(reported(reports, "")[-1]).get("received", "0") != "0", "the prediction of two axes")
    assert lab.call(Trigger, "axes_model_node/zero").success
    assert lab.processes[0].is_running


@pytest.mark.parametrize("axes", ["/stage_x, /stage_x", "stage_x,/stage_x/", "/a b", "x//y", "{stage}"])
def test_invalid_namespaces_end_the_start_with_one_line(lab, axes):
    node = lab.start("axes_model_node", axes=axes)
    assert node.wait() == 2
    assert f"axes: got '{axes}', expected namespaces such as /stage_x,/stage_y" in node.output.strip().splitlines()[-1]


def test_clocks_that_differ_and_a_block_without_an_axis_are_told(lab, model, tmp_path):
    reports = lab.listen(DiagnosticArray, "/diagnostics", 10)
    predicted = lab.listen(PointCloud2, "/stage_x/predicted_samples", DEEP)
    two = identify_axes([plant(seed, gains=GAINS[:2, :2]) for seed in (1, 2)], length=5)
    lab.start("axes_model_node", axes="/stage_x,/stage_y", model_file=str(axes_file.save(two, tmp_path / "model.npz")))
    publishers = [lab.publisher(PointCloud2, f"/stage_{axis}/samples", DEEP) for axis in "xy"]
    lab.wait(lambda: lab.node.count_publishers("/stage_x/predicted_samples"), "the model node")

    def send(first, late, further=()):
        """A tenth of a second of both axes, the second of which may be late [s]."""
        for number, publisher in enumerate(publishers):
            at = first + np.arange(100)
            stamp = 10**18 + round((first * 1e-3 + late * number) * 1e9)
            channels = {name: np.zeros(100) for name in further}
            u, phase = 0.2 * np.sin(0.1 * at), np.zeros(100, np.uint32)
            index = at.astype(np.uint32)
            block = SampleBlock(stamp, 1e-3 * np.arange(100), u, 1e-6 * u, index, phase, channels=channels)
            publisher.publish(samples_to_cloud(block))

    def keep_sending(first, late, what, **named):
        """Blocks at the pace of the clock until the node says something."""
        for _ in range(200):
            send(first, late, **named)
            first += 100
            lab.pause(0.1)
            if reported(reports, what):
                return first
        pytest.fail(f"waited 20 s for '{what}'\n{lab.processes[0].output}")

    first = keep_sending(0, 0.0, "predicting")
    assert predicted[-1].is_dense
    begun = len(predicted)
    first = keep_sending(first, 5.0, "no samples of the same time, the newest are 5 s apart")
    assert reported(reports, "the stamps of /stage_y moved by 5 s; all axes were joined anew")
    first = keep_sending(first, 5.0, "got 4 drives and 2 displacements", further=["voltage_2"])
    assert not any(cloud.is_dense for cloud in predicted[begun + 2 :])
