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

"""`TOPICS`: the table of all topics of an axis.

Publishers, subscriptions and the recorder take name, type and quality of service from here. `make docs` writes the
tables of topics and the rights in ``config/sros2_policy.xml`` from it; a test compares ``config/record_qos.yaml`` with
it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass, replace
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import JointState, PointCloud2
from std_msgs.msg import Float64, String

from ..errors import ParameterError
from .runtime.qos import COMMAND, COMMAND_STATUS, DEEP, LATCHED, SAMPLES, STATUS

ANYONE = "anyone"
"""Publisher of the topics that move a stage: every program with the right to do so."""
ALL = "all"
"""Publisher of the topics that every node of the package publishes."""


@dataclass(frozen=True, slots=True)
class Topic:
    """One topic of an axis.

    Parameters
    ----------
    name : str
        Relative to the namespace of the axis, or absolute.
    type : type
        Class of its messages.
    quality : rclpy.qos.QoSProfile
        Quality of service of its publishers.
    unit : str
        Unit of its values; empty where they have none.
    rate : str
        Rate of its messages; empty where the publisher decides it.
    by : str
        Node that publishes it, `ANYONE` or `ALL`.
    senders : tuple of str
        Further nodes of the package that publish it.
    readers : tuple of str
        Nodes that always subscribe to it; the recorder of the identification node takes every topic.
    """

    name: str
    type: Any
    quality: QoSProfile
    unit: str
    rate: str
    by: str
    senders: tuple[str, ...] = ()
    readers: tuple[str, ...] = ()

    @property
    def type_name(self) -> str:
        """Type as the command line writes it: ``std_msgs/msg/Float64``."""
        return f"{self.type.__module__.split('.')[0]}/msg/{self.type.__name__}"

    @property
    def is_latched(self) -> bool:
        """True where a late joiner receives the last messages."""
        return bool(self.quality.durability == DurabilityPolicy.TRANSIENT_LOCAL)

    @property
    def overriding(self) -> QoSOverridingOptions | None:
        """Options by which parameters change history, depth and reliability; None for latched topics.

        Their names are ``qos_overrides.<topic>.<publisher or subscription>.<policy>``. rclpy writes them into the
        profile that it is given.
        """
        return None if self.is_latched else QoSOverridingOptions.with_default_policies()

    @property
    def deep(self) -> QoSProfile:
        """Quality of service of a subscription that must not miss a message while the machine is busy."""
        return QoSProfile(depth=DEEP.depth, reliability=self.quality.reliability, durability=self.quality.durability)


QOS_OVERRIDES = "qos_overrides."
"""Beginning of the names of the parameters that change quality of service."""

DIAGNOSTICS = "/diagnostics"
"""Topic of the health of all nodes of a system."""

TOPICS: dict[str, Topic] = {
    topic.name: topic
    for topic in (
        Topic(
            "samples", PointCloud2, SAMPLES, "V, m, s", "one block per `block_duration` (10 ms)", "driver",
            readers=("driver", "model", "compensation", "page"),
        ),
        Topic("voltage", Float64, COMMAND, "V", "`live_rate` (50 Hz)", "driver", readers=("compensation",)),
        Topic("displacement", Float64, COMMAND, "m", "`live_rate`", "driver"),
        Topic("live", JointState, COMMAND, "V, m", "`live_rate`", "driver"),
        Topic("phase", String, LATCHED, "", "at every change", "driver", readers=("page",)),
        Topic(
            "command", PointCloud2, COMMAND, "V", "", ANYONE, senders=("identification", "compensation"),
            readers=("driver",),
        ),
        Topic("set_voltage", Float64, COMMAND, "V", "", ANYONE, senders=("compensation",), readers=("driver",)),
        Topic(
            "claim", KeyValue, COMMAND, "", "", ANYONE, senders=("identification", "compensation"), readers=("driver",)
        ),
        Topic(
            "claimed_by", String, LATCHED, "", "at every change", "driver", readers=("identification", "compensation")
        ),
        Topic(
            "command_status", DiagnosticStatus, COMMAND_STATUS, "", "at every event", "driver",
            readers=("compensation",),
        ),
        Topic("predicted_samples", PointCloud2, SAMPLES, "m, s", "as `samples`", "model", readers=("page",)),
        Topic("prediction", Float64, COMMAND, "m", "`live_rate`", "model"),
        Topic("residual", Float64, COMMAND, "m", "`live_rate`", "model"),
        Topic("residual_rms", Float64, COMMAND, "m", "`live_rate`", "model", readers=("page",)),
        Topic("predicted_live", JointState, COMMAND, "V, m", "`live_rate`", "model"),
        Topic("change", DiagnosticStatus, COMMAND, "", "1 Hz, and at every alarm", "model", readers=("page",)),
        Topic("recalibrations", String, LATCHED, "", "at every recalibration", "model", readers=("page",)),
        Topic(
            "recalibrated_model", String, COMMAND, "", "at every recalibration", "model", readers=("identification",)
        ),
        Topic(
            "model", String, LATCHED, "", "at every new model", "identification",
            readers=("model", "compensation", "page"),
        ),
        Topic(
            "status", DiagnosticStatus, STATUS, "", "at every step", "identification", senders=("compensation",),
            readers=("page",),
        ),
        Topic("trajectory", PointCloud2, COMMAND, "m, s", "", ANYONE, readers=("compensation",)),
        Topic("set_displacement", Float64, COMMAND, "m", "", ANYONE, readers=("compensation",)),
        Topic("tracking_error", Float64, COMMAND, "m", "50 Hz while a trajectory plays", "compensation"),
        Topic("tracking_rms", Float64, COMMAND, "m", "50 Hz while a trajectory plays", "compensation"),
        Topic(DIAGNOSTICS, DiagnosticArray, QoSProfile(depth=10), "", "1 Hz", ALL, readers=("driver", "page")),
    )
}  # fmt: skip
"""Topics of an axis by name, in the order of the docs."""


def advertise(node: Node, name: str, namespace: str = "") -> Any:
    """A publisher of one of `TOPICS`; raises ParameterError where a parameter names an unknown quality of service."""
    topic = in_namespace(TOPICS[name], namespace)
    with _override_named(node, topic):
        return node.create_publisher(
            topic.type, topic.name, copy(topic.quality), qos_overriding_options=topic.overriding
        )


def in_namespace(topic: Topic, namespace: str) -> Topic:
    """The topic of the axis in another namespace than that of the node; empty for that of the node."""
    return replace(topic, name=f"{namespace.rstrip('/')}/{topic.name}") if namespace else topic


def advertise_lifecycle(node: LifecycleNode, name: str) -> Any:
    """As `advertise`; it publishes nothing while its node is not active."""
    topic = TOPICS[name]
    with _override_named(node, topic):
        quality = copy(topic.quality)
        return node.create_lifecycle_publisher(topic.type, topic.name, quality, qos_overriding_options=topic.overriding)


def subscribe(
    node: Node,
    name: str,
    callback: Callable[[Any], None],
    namespace: str = "",
    *,
    deep: bool = False,
    raw: bool = False,
) -> Any:
    """A subscription to one of `TOPICS`.

    Parameters
    ----------
    node : rclpy.node.Node
    name : str
        Of the topic.
    callback : callable
        Called with every message.
    namespace : str
        Namespace of the axis; empty for that of the node.
    deep : bool
        Miss no message while the machine is busy.
    raw : bool
        Receive messages as serialised bytes.

    Raises
    ------
    ParameterError
        If a parameter names an unknown quality of service.
    """
    topic = in_namespace(TOPICS[name], namespace)
    quality = topic.deep if deep else copy(topic.quality)
    with _override_named(node, topic):
        return node.create_subscription(
            topic.type, topic.name, callback, quality, raw=raw, qos_overriding_options=topic.overriding
        )


@contextmanager
def _override_named(node: Node, topic: Topic) -> Iterator[None]:
    try:
        yield
    except RuntimeError as error:  # rclpy raises this for an unknown policy
        beginning = f"{QOS_OVERRIDES}{node.resolve_topic_name(topic.name)}."
        is_given = any(name.startswith(beginning) for name in node._parameter_overrides)
        if isinstance(error, rclpy_implementation.RCLError) and not is_given:
            raise
        raise ParameterError(f"qos_overrides of {topic.name}: {error}; expected a policy of ROS 2") from None
