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

"""Driver, model and identification node in one process do what they do in three."""

import signal

import pytest
from sensor_msgs.msg import PointCloud2
from std_srvs.srv import Trigger

from piezo_hysteresis.model.model_file import save
from piezo_hysteresis.nodes.runtime.qos import SAMPLES

from .test_replay import MODEL, PERIOD

pytestmark = pytest.mark.nodes


def test_one_process_streams_predicts_plans_and_ends_safe(lab):
    file = str(save(MODEL, lab.folder / "model.yaml"))
    axis = lab.start("axis_node", sample_period=PERIOD, model_file=file, discovery_time=0.1)
    predicted = lab.listen(PointCloud2, "predicted_samples", SAMPLES)
    lab.wait(lambda: predicted, "predictions")
    lab.wait(lambda: lab.call(Trigger, "identification_node/plan").success, "a plan")
    axis.signal(signal.SIGINT)
    assert axis.wait() == 0
    assert "safe voltage" in axis.output
