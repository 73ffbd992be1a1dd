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

"""Parameters change the quality of service of a topic, and words that mean nothing are refused."""

import pytest
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState, PointCloud2
from std_msgs.msg import Float64

from piezo_hysteresis.errors import ParameterError
from piezo_hysteresis.nodes.messages.frame import frame_name
from piezo_hysteresis.nodes.topics import advertise

pytestmark = pytest.mark.nodes

VOLTAGE = "qos_overrides./voltage.publisher.reliability"
BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)


def test_a_driver_uses_the_qos_of_its_parameters_and_the_frame_of_its_axis(lab):
    lab.driver("-p", f"{VOLTAGE}:=best_effort", frame_id="lab/mirror", sample_period=1e-4)
    live, samples = lab.listen(JointState, "live"), lab.listen(PointCloud2, "samples")
    voltage = lab.listen(Float64, "voltage", BEST_EFFORT)
    lab.wait(lambda: live and samples and voltage, "samples")
    assert {live[0].header.frame_id, samples[0].header.frame_id} == {"lab/mirror"}
    (reported,) = lab.node.get_publishers_info_by_topic("/voltage")
    assert reported.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT


def test_an_unknown_qos_policy_is_refused_in_one_line(lab):
    refused = "qos_overrides./prediction.publisher.reliability:=besteffort"
    node = lab.start("model_node", "-p", refused, fresh=True)
    assert node.wait() == 2
    assert "qos_overrides of prediction" in node.output


def test_a_fault_of_the_middleware_is_no_wrong_qos_override(lab, monkeypatch):
    def fail(*arguments, **named):
        raise rclpy_implementation.RCLError("out of time")

    monkeypatch.setattr(lab.node, "create_publisher", fail)
    with pytest.raises(rclpy_implementation.RCLError, match="out of time"):
        advertise(lab.node, "prediction")


@pytest.mark.parametrize("wrong", ["/stage_x", "a b", "x/", "a//b", "µ"])
def test_frames_are_names_that_tf_takes(wrong):
    with pytest.raises(ParameterError, match="frame_id"):
        frame_name(wrong, "/")
