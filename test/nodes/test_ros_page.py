"""docs/ros.md says what the nodes really publish, subscribe and serve, no more and no less."""

import re
from pathlib import Path

import pytest
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

pytestmark = pytest.mark.nodes

PAGE = (Path(__file__).parents[2] / "docs" / "ros.md").read_text()
NODES = {"driver": "driver_node", "model": "model_node", "identification": "identification_node"}
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
    """The three nodes, all found."""
    shared_lab.driver()
    for executable in ("model_node", "identification_node"):
        shared_lab.start(executable)
    there = shared_lab.node.get_node_names
    shared_lab.wait(lambda: set(NODES.values()) <= set(there()), "all nodes")
    last = {"driver_node": "/samples", "model_node": "/predicted_live", "identification_node": "/command"}
    for node, topic in last.items():
        shared_lab.wait(lambda node=node, topic=topic: topic in published(shared_lab, node), f"{topic} of the {node}")
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
        for node in NODES if by == "all" else [by] if by in NODES else []:
            documented[node]["/" + name.lstrip("/")] = kind
    documented["identification"]["/command"] = "sensor_msgs/PointCloud2"
    for node, topics in documented.items():
        assert published(nodes, NODES[node]) == topics, node


def test_quality_of_service_is_as_documented(nodes):
    for name, (_, _, quality, _, by) in rows("Topics"):
        if by not in NODES:
            continue
        (info,) = nodes.node.get_publishers_info_by_topic("/" + name)
        profile = info.qos_profile
        assert (profile.reliability == ReliabilityPolicy.RELIABLE) == quality.startswith("reliable"), name
        assert (profile.durability == DurabilityPolicy.TRANSIENT_LOCAL) == ("transient local" in quality), name


def test_what_anyone_may_publish_is_subscribed_by_the_driver(nodes):
    listened = dict(nodes.node.get_subscriber_names_and_types_by_node("driver_node", "/"))
    open_to_all = {f"/{name}": cells[0] for name, cells in rows("Topics") if cells[-1] == "anyone"}
    real = {n: kinds[0].replace("/msg/", "/") for n, kinds in listened.items() if n not in OF_ROS}
    assert real == open_to_all


def test_every_service_is_served_as_documented(nodes):
    documented = {f"/{name}": cells[0] for name, cells in rows("Services")}
    real = {}
    for node in NODES.values():
        for name, kinds in nodes.node.get_service_names_and_types_by_node(node, "/"):
            if kinds[0].startswith("std_srvs"):
                real[name] = kinds[0].replace("/srv/", "/")
    assert real == documented
