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

"""What a driver answers that never reached its stage: nothing about the stage."""

import pytest
from std_srvs.srv import Trigger

pytestmark = pytest.mark.nodes


def test_a_driver_that_does_not_know_its_stage_does_not_say_that_it_is_safe(lab):
    lab.driver(autostart=False)
    stopped, cancelled = (lab.call(Trigger, f"driver_node/{word}") for word in ("stop", "cancel"))
    assert stopped.success and not cancelled.success
    for answer in (stopped, cancelled):
        assert "does not know its stage" in answer.message
        assert "safe" not in answer.message
    assert "nothing moves until ~/release" in stopped.message
