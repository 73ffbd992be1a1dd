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

"""What the nodes answer and log is what is so."""

import signal

import pytest
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Float64, String
from std_srvs.srv import Trigger

from benchmarks.naming_cases import Case
from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.model.model_file import save
from piezo_hysteresis.nodes.messages.conversions import values_of
from piezo_hysteresis.recording import read, write

from .identification.test_identification_node import Identification

pytestmark = pytest.mark.nodes

PERIOD = 1e-4
EVERY = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def test_abort_of_a_diagnosis_reports_that_the_stage_was_not_moved(lab):
    driver = lab.driver(sample_period=PERIOD)
    samples, ask = lab.streaming(), lab.publisher(Float64, "set_voltage")
    identification = Identification(lab)
    recording = identification.runs / "0_given"
    write(Case("poor", ("creep",), 0, 5e-4).experiment(), recording)
    ask.publish(Float64(data=4.0))
    lab.wait(lambda: samples.newest.voltage[-1] > 3.99, "the set-point")
    request = SetParameters.Request(parameters=[Parameter("experiment", value=str(recording)).to_parameter_msg()])
    assert lab.call(SetParameters, "identification_node/set_parameters", request).results[0].successful
    assert identification.ask("diagnose").success
    assert identification.ask("abort").success
    assert "left as it is" in identification.await_state("aborted").message
    assert samples.newest.voltage[-1] > 3.99
    assert "diagnosing" in identification.process.output
    for _ in range(200):
        ask.publish(Float64(data=99.0))
        lab.pause(0.005)
    assert driver.output.count("refused 'set_voltage'") <= 5


def test_plan_of_a_driver_that_was_killed_has_no_limits(lab):
    driver = lab.driver(sample_period=PERIOD)
    identification = Identification(lab)
    lab.wait(lambda: identification.ask("plan").success, "the driver's limits")
    driver.signal(signal.SIGKILL)
    driver.wait()
    lab.pause(3.5)
    answer = identification.ask("plan")
    assert not answer.success
    assert answer.message.startswith("no limits: waiting for an answer of 'driver_node'")
    assert identification.ask("identify").message.startswith("waiting up to 30 s for an answer of 'driver_node'")


def test_identify_without_a_driver_answers_that_it_waits_for_one(lab):
    identification = Identification(lab)
    answer = identification.ask("identify")
    assert answer.message.startswith("waiting up to 30 s for a configured 'driver_node' in /")
    assert "; then recording to " in answer.message
    assert identification.ask("abort").success


def test_a_claimed_stage_is_not_identified(lab):
    lab.driver(sample_period=PERIOD)
    identification, claims = Identification(lab), lab.publisher(KeyValue, "claim")
    lab.wait(lambda: identification.ask("plan").success, "the driver's limits")
    owners = lab.listen(String, "claimed_by", EVERY)
    lab.wait(
        lambda: claims.publish(KeyValue(key="me", value="claim")) or (owners and owners[-1].data == "me"), "the claim"
    )
    lab.wait(lambda: "claimed by me" in identification.ask("identify").message, "the refusal")
    assert not identification.ask("identify").success


def test_a_recording_that_is_not_there_is_not_diagnosed(lab):
    identification = Identification(lab, experiment=str(lab.folder / "nowhere"))
    answer = identification.ask("diagnose")
    assert not answer.success
    assert answer.message == f"no experiment {lab.folder / 'nowhere'}; set 'experiment', or identify first"


def test_services_that_need_samples_refuse_after_the_driver_has_died(lab):
    driver = lab.driver(sample_period=PERIOD)
    save(Model((BoucWen(), Arx()), PERIOD), lab.folder / "model.yaml")
    model = {"model_file": str(lab.folder / "model.yaml")}
    lab.start("model_node", baseline_folder=str(lab.folder), **model)
    lab.start("compensation_node", **model)
    lab.wait(lambda: lab.call(Trigger, "model_node/baseline").success, "a prediction")
    lab.wait(lambda: "no trajectory" in lab.call(Trigger, "compensation_node/learn").message, "the driver")
    driver.signal(signal.SIGKILL)
    driver.wait()
    lab.pause(3.5)
    for service, reason in (
        ("model_node/baseline", "no prediction: start the driver"),
        ("compensation_node/learn", "no driver: waiting for an answer"),
    ):
        answer = lab.call(Trigger, service)
        assert not answer.success
        assert answer.message.startswith(reason)


def test_every_phase_is_logged_and_reported_to_late_subscribers(lab):
    driver = lab.driver(sample_period=PERIOD, real_time_factor=4.0)
    identification = Identification(lab)
    identification.begin()
    lab.wait(lambda: values_of(identification.statuses[-1])["phase"].startswith("4 of"), "the fourth phase", 90.0)
    late = lab.listen(DiagnosticStatus, "status", EVERY)
    before = {"1 of 16 conditioning", "2 of 16 rest"}
    lab.wait(lambda: before <= {values_of(status)["phase"] for status in list(late)}, "the statuses before")
    assert identification.ask("abort").success
    identification.await_state("aborted")
    for line in ("recording to", "running: 1 of 16 conditioning", "running: 2 of 16 rest", "aborted"):
        assert line in identification.process.output
    driver.signal(signal.SIGINT)
    assert driver.wait() == 0
    for line in ("active: samples flow", "not active any more", "shut down"):
        assert line in driver.output


def test_a_remapped_topic_is_recorded_under_its_own_name(lab):
    lab.driver("-r", "samples:=raw", sample_period=PERIOD, real_time_factor=4.0)
    identification = Identification(lab, "-r", "samples:=raw")
    path = identification.begin()
    lab.wait(lambda: values_of(identification.statuses[-1])["phase"].startswith("2 of"), "the second phase", 90.0)
    assert identification.ask("abort").success
    identification.await_state("aborted")
    assert "conditioning" in {record.phase for record in read(path)}


def test_missing_simulated_time_is_reported(lab):
    lab.start("model_node", use_sim_time=True)
    health = lab.diagnostics()

    def reported():
        return [s for array in list(health) for s in array.status if "no message arrives on /clock" in s.message]

    lab.wait(reported, "the warning")
    assert reported()[0].level != DiagnosticStatus.OK


def test_only_a_cold_start_reports_that_kernels_are_compiled(lab):
    warm = lab.start("model_node")
    lab.wait(lambda: "listening on samples" in warm.output, "the model node")
    assert "compiling" not in warm.output
    warm.signal(signal.SIGINT)
    warm.wait()
    cold = lab.start("model_node", fresh=True, environment={"NUMBA_CACHE_DIR": str(lab.folder)})
    lab.wait(lambda: "compiling kernels, once; this takes about 30 s" in cold.output, "the line of a cold start")
    cold.signal(signal.SIGKILL)


@pytest.mark.parametrize("after", [0.1, 0.4, 0.8])
@pytest.mark.parametrize("executable", ["driver_node", "model_node", "identification_node"])
def test_an_interrupt_while_a_node_starts_shows_no_traceback(lab, executable, after):
    process = lab.start(executable, fresh=True)
    lab.wait(lambda: process.is_importing or not process.is_running, "the start of Python")
    lab.pause(after)
    process.signal(signal.SIGINT)
    process.wait()
    assert "Traceback" not in process.output
