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

"""`companion_node`: a further ROS node in the process of a node, with an executor of its own."""

from __future__ import annotations

from rclpy.node import Node


def companion_node(node: Node, suffix: str) -> Node:
    """A node in the namespace of `node`, with the name of `node` and a suffix, whatever the name is remapped to."""
    return Node(
        f"{node.get_name()}{suffix}",
        context=node.context,
        namespace=node.get_namespace(),
        use_global_arguments=False,  # they may rename the node
        enable_rosout=False,
        start_parameter_services=False,
    )
