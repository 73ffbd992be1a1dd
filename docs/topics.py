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

"""What `make docs` takes from the table of topics: the table of the pages, and the rights in the SROS2 policy."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from piezo_hysteresis.nodes.topics import ALL, ANYONE, TOPICS, Topic

POLICY = Path(__file__).parents[1] / "config" / "sros2_policy.xml"
"""Access control for one axis."""
NODES = ("driver", "model", "identification", "compensation")
"""Nodes of the package that publish at all times."""
PAGE = "page"
"""Key of the node that only subscribes and calls services."""
RECORDERS = ("identification", "operator")
"""Keys that may take every topic of an axis."""
OF_JOBS = ("claimed_by", "model", "status")
"""Topics that a program needs which calls the actions."""
OF_ROS = {"publish": ("/rosout", "/parameter_events"), "subscribe": ("/clock",)}
"""Topics of ROS itself that every node of the package uses."""
PROFILE = re.compile(r'(<profile ns="/stage_x" node="(\w+?)(?:_node)?">)(.*?)(</profile>)', re.DOTALL)
"""One key of the policy, with the word of its node."""
RIGHT = re.compile(r'(<topics (publish|subscribe)="ALLOW">\n).*?( *</topics>)', re.DOTALL)
"""The topics that a key may publish, or subscribe to."""


def rows() -> Iterator[tuple[str, ...]]:
    """Cells of the table of topics."""
    for topic in TOPICS.values():
        kind = topic.type_name.replace("/msg/", "/")
        by = topic.by if topic.by == ANYONE else ", ".join((topic.by, *topic.senders))
        yield f"`{topic.name}`", kind, topic.unit, quality(topic), topic.rate, by


def quality(topic: Topic) -> str:
    """Quality of service in words."""
    return f"reliable, {'transient local, ' if topic.is_latched else ''}keep last {topic.quality.depth}"


def may(key: str, right: str) -> list[str]:
    """Names that a key of the policy may publish, or subscribe to."""
    names = list(OF_ROS[right]) if key in (*NODES, PAGE) or right == "publish" else []
    if right == "subscribe" and key in RECORDERS:
        names.append("*")  # by a pattern: Fast DDS exchanges no long permissions
    for topic in TOPICS.values():
        if right == "publish":
            by_node = topic.by == key or key in topic.senders or (topic.by == ALL and key in NODES)
            allowed = by_node or (topic.by == ANYONE and key == "operator")
        else:
            looks = key == "observer" and topic.by != ANYONE
            asks = key == "planner" and topic.name in OF_JOBS
            allowed = key in topic.readers or looks or asks or (key in RECORDERS and topic.name.startswith("/"))
        if allowed:
            names.append(topic.name)
    if key == "driver" and right == "publish":
        names.append("driver_node/transition_event")  # the state of a lifecycle node
    return names


def policy(text: str) -> str:
    """The policy with the new topics of every key."""

    def profile(found: re.Match[str]) -> str:
        def right(block: re.Match[str]) -> str:
            lines = (f"            <topic>{name}</topic>\n" for name in may(found[2], block[2]))
            return block[1] + "".join(lines) + block[3]

        return found[1] + RIGHT.sub(right, found[3]) + found[4]

    return PROFILE.sub(profile, text)
