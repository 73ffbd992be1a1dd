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

"""A second node of the same name ends: both would carry out each request, and each would send its own answer."""

import pytest

pytestmark = pytest.mark.nodes


@pytest.mark.parametrize("executable", ["driver_node", "model_node", "axes_model_node", "compensation_node"])
def test_a_second_node_of_the_same_name_ends_with_one_line(lab, executable):
    first = lab.start(executable)
    lab.wait(lambda: executable in lab.node.get_node_names(), "the first")
    second = lab.start(executable)
    assert second.wait() == 2
    assert second.output.count("\n") == 1
    assert f"the name /{executable} in domain" in second.output and "is held by process" in second.output
    assert first.is_running
