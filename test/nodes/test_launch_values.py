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

"""What launch arguments mean, and one identification node for a driver."""

import signal
from pathlib import Path
from xml.etree import ElementTree

import pytest

from piezo_hysteresis.errors import ParameterError
from piezo_hysteresis.nodes.runtime.launch_values import (
    parameter_file,
    require_computer_clock,
    switch,
    transports,
)


@pytest.mark.parametrize(
    ("text", "value"), [("true", True), ("True", True), ("1", True), ("False", False), ("0", False)]
)
def test_a_switch_accepts_the_usual_words(text, value):
    assert switch("autostart", text) is value


@pytest.mark.parametrize("text", ["", "yes", "TRUE", " true", "2", "nonsense\x1b[2J"])
def test_other_words_are_refused(text):
    with pytest.raises(ParameterError, match="expected one of true, True, 1, false, False, 0"):
        switch("autostart", text)


def test_a_parameter_file_that_is_missing_is_refused(tmp_path):
    file = tmp_path / "stage.yaml"
    with pytest.raises(ParameterError, match="expected a file that exists"):
        parameter_file("params_file", str(file))
    with pytest.raises(ParameterError):
        parameter_file("params_file", str(tmp_path))
    file.touch()
    assert parameter_file("params_file", str(file)) == [str(file)]
    assert parameter_file("params_file", "") == []


def test_a_process_with_a_driver_takes_no_simulated_time():
    require_computer_clock(False)
    with pytest.raises(ParameterError, match="use_sim_time: got true with one_process"):
        require_computer_clock(True)


@pytest.mark.nodes
def test_one_identification_node_per_driver(lab):
    """The second one of a driver does not start; that of another driver does; a killed one leaves no lock."""
    first = lab.start("identification_node")
    lab.wait(lambda: "identification_node" in lab.node.get_node_names(), "the first node")
    second = lab.start("identification_node", fresh=True)
    assert second.wait() == 2
    assert f"is held by process {first.pid} already" in second.output
    other = lab.start("identification_node", namespace="/other")
    lab.wait(lambda: ("identification_node", "/other") in lab.node.get_node_names_and_namespaces(), "another axis")
    first.signal(signal.SIGKILL)
    first.wait()
    again = lab.start("identification_node")
    lab.pause(3.0)
    assert again.is_running
    assert other.is_running


@pytest.mark.parametrize("chosen", ["FASTDDS_BUILTIN_TRANSPORTS", "FASTDDS_DEFAULT_PROFILES_FILE"])
def test_launch_files_give_room_to_readers_unless_the_user_has_chosen_transports(chosen):
    config = Path(__file__).parents[2] / "config"
    ((name, file),) = transports({}, config).items()
    assert name == "FASTDDS_DEFAULT_PROFILES_FILE"
    assert Path(file).is_file()
    assert transports({chosen: "SHM"}, config) == {}


def test_both_profiles_of_fast_dds_have_the_same_room_and_the_one_of_the_launch_files_reaches_other_machines():
    config = Path(__file__).parents[2] / "config"
    space = "{http://www.eprosima.com}"
    rooms = []
    for name in ("large_blocks.xml", "launch_transports.xml"):
        tree = ElementTree.parse(config / name)
        known = {t.findtext(f"{space}transport_id"): t for t in tree.iter(f"{space}transport_descriptor")}
        used = [known[t.text] for t in tree.find(f".//{space}userTransports")]
        kinds = [t.findtext(f"{space}type") for t in used]
        assert kinds[0] == "SHM"
        rooms.append({child.tag: child.text for child in used[0] if not child.tag.endswith("transport_id")})
    assert rooms[0] == rooms[1]
    assert kinds == ["SHM", "UDPv4"]
