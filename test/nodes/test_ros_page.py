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

"""docs/ros.md says what the nodes really publish, subscribe and serve, no more and no less."""

import fnmatch
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

from piezo_hysteresis.nodes.runtime.job_actions import SUFFIX
from piezo_hysteresis.nodes.topics import ANYONE, TOPICS

pytestmark = pytest.mark.nodes

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "ros.md").read_text()
POLICY = ROOT / "config" / "sros2_policy.xml"
NODES = {
    "driver": "driver_node",
    "model": "model_node",
    "identification": "identification_node",
    "compensation": "compensation_node",
}
ALL_NODES = (*NODES.values(), "driver_node_stop", "page_node")
OF_ROS = {"/rosout", "/parameter_events", "/clock"}


def rows(heading):
    """Cells of the table under a heading, the names of the first cell apart."""
    table = PAGE.split(f"\n## {heading}\n", 1)[1].split("\n\n#", 1)[0]
    for line in table.splitlines():
        if line.startswith("| `"):
            first, *cells = (cell.strip() for cell in line.strip("|").split("|"))
            for name in re.findall(r"`([^`]+)`", first):
                yield name, cells


@pytest.fixture(scope="module")
def nodes(shared_lab):
    """The nodes of an axis, all found."""
    shared_lab.driver()
    for executable in ("model_node", "identification_node", "compensation_node"):
        shared_lab.start(executable)
    shared_lab.start("page_node", port=0, axes="/")
    there = shared_lab.node.get_node_names
    last = {
        "driver_node": "/samples",
        "model_node": "/predicted_live",
        "identification_node": "/model",
        "compensation_node": "/set_voltage",
    }
    try:
        shared_lab.wait(lambda: set(ALL_NODES) <= set(there()), "all nodes")
        for node, topic in last.items():
            shared_lab.wait(
                lambda node=node, topic=topic: topic in published(shared_lab, node), f"{topic} of the {node}"
            )
    except BaseException:  # the next attempt begins with nodes of its own
        for process in shared_lab.processes:
            process.end()
        raise
    return shared_lab


def published(lab, node):
    """Topics of a node that are its own, with their types."""
    return {
        name: kinds[0].replace("/msg/", "/")
        for name, kinds in lab.node.get_publisher_names_and_types_by_node(node, "/")
        if name not in OF_ROS and not name.endswith("/transition_event")
    }


def test_every_topic_is_published_as_documented(nodes):
    documented = {node: {} for node in NODES}
    for name, (kind, _, _, _, by) in rows("Topics"):
        for node in NODES if by == "all" else NODES.keys() & by.split(", "):
            documented[node]["/" + name.lstrip("/")] = kind
    for topic in TOPICS.values():
        for node in topic.senders:
            documented[node]["/" + topic.name] = topic.type_name.replace("/msg/", "/")
    for node, topics in documented.items():
        nodes.wait(lambda node=node, topics=topics: published(nodes, NODES[node]) == topics, f"the topics of {node}")


def test_quality_of_service_is_as_documented(nodes):
    for name, (_, _, quality, _, by) in rows("Topics"):
        if not NODES.keys() & by.split(", "):
            continue
        for info in nodes.node.get_publishers_info_by_topic("/" + name):
            profile = info.qos_profile
            assert (profile.reliability == ReliabilityPolicy.RELIABLE) == quality.startswith("reliable"), name
            assert (profile.durability == DurabilityPolicy.TRANSIENT_LOCAL) == ("transient local" in quality), name


def test_every_input_topic_has_a_subscriber(nodes):
    for node in ("driver", "compensation"):
        listened = dict(nodes.node.get_subscriber_names_and_types_by_node(NODES[node], "/"))
        open_to_all = {
            f"/{topic.name}": topic.type_name.replace("/msg/", "/")
            for topic in TOPICS.values()
            if topic.by == ANYONE and node in topic.readers
        }
        assert open_to_all
        assert open_to_all.items() <= {n: kinds[0].replace("/msg/", "/") for n, kinds in listened.items()}.items()
    heard = {name for node in NODES for name, topic in TOPICS.items() if topic.by == ANYONE and node in topic.readers}
    assert heard == {name for name, cells in rows("Topics") if cells[-1] == "anyone"}


def test_every_service_is_served_as_documented(nodes):
    documented = {f"/{name}": cells[0] for name, cells in rows("Services") if not name.startswith("axes_model_node/")}
    nodes.wait(lambda: documented.keys() <= served(nodes).keys(), "every service that is documented")
    assert served(nodes) == documented


def served(nodes):
    """Services of all nodes that are not rclpy's own, with their types."""
    return {
        name: kinds[0].replace("/srv/", "/")
        for node in ALL_NODES
        for name, kinds in nodes.node.get_service_names_and_types_by_node(node, "/")
        if kinds[0].startswith("std_srvs")
    }


def allowed(node):
    """Names that the security policy allows a node, by right; those in its namespace begin with '/' here."""
    root = ElementTree.parse(POLICY).getroot()
    (profile,) = root.iterfind(f"enclaves/enclave/profiles/profile[@node='{node}']")
    names = {}
    for kind in profile:
        (right,) = kind.attrib
        assert kind.attrib[right] == "ALLOW"
        names.setdefault(right, set()).update("/" + name.text.lstrip("/") for name in kind)
    return names


@pytest.mark.parametrize("node", ALL_NODES)
def test_the_security_policy_allows_exactly_the_topics_of_a_node(nodes, node):
    def of(what):
        return {name for name, _ in getattr(nodes.node, f"get_{what}_names_and_types_by_node")(node, "/")}

    policy = allowed(node)
    assert policy["publish"] == of("publisher") | {"/rosout", "/parameter_events"}
    own = of("subscriber") - OF_ROS
    if node == "identification_node":
        own |= {"/" + name.lstrip("/") for name in TOPICS}  # while it records
    if node == "driver_node":
        own |= {"/samples", "/diagnostics"}  # before it begins, to find another driver
    clock = set() if node == "driver_node_stop" else {"/clock"}  # a stop asks no clock
    heard, recorded = own | clock, {"/*"} if node == "identification_node" else set()
    assert policy.get("subscribe", set()) - recorded <= heard
    assert {n for pattern in policy.get("subscribe", ()) for n in fnmatch.filter(heard, pattern)} == heard
    assert {n for pattern in policy["reply"] for n in fnmatch.filter(of("service"), pattern)} == of("service")
    assert all(n.startswith(f"/{node}/") or "*" not in n for n in policy["reply"])  # its own names
    assert all(fnmatch.filter(of("service"), pattern) for pattern in policy["reply"])
    assert policy.get("request", set()) == of("client")


def test_the_policy_grants_the_actions_to_the_nodes_that_serve_them_and_to_the_planner():
    kinds = {path.stem.lower() for path in (ROOT / "interfaces" / "action").glob("*.action")}
    served = {"/identification_node/identify", "/identification_node/diagnose", "/compensation_node/track"}
    assert {name.rpartition("/")[2] for name in served} == kinds
    assert allowed("planner")["call"] == served
    for node in ("identification_node", "compensation_node"):
        assert allowed(f"{node}{SUFFIX}")["execute"] == {f"/{node}/*"}
        assert allowed(f"{node}{SUFFIX}")["reply"] == {f"/{node}{SUFFIX}/get_type_description"}
    for key in (*NODES.values(), "operator", "observer"):
        assert not {"call", "execute"} & allowed(key).keys()
    assert allowed("planner")["publish"] == {"/rosout", "/parameter_events"}
    assert "request" not in allowed("planner")


def test_comments_of_the_policy_do_not_disturb_sros2():
    whole = ElementTree.parse(POLICY, ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True)))
    assert [e.tag for e in whole.getroot().find("enclaves")] == ["enclave"] * 8


def test_the_policy_has_keys_for_operator_and_observer():
    operator, observer = allowed("operator"), allowed("observer")
    assert {"/command", "/set_voltage"} <= operator["publish"]
    assert not {"/command", "/set_voltage", "/samples", "/model"} & observer["publish"]
    assert "request" not in observer
    assert not any("set_parameters" in name for name in operator["request"] if "identification" not in name)
