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

"""ROS parameters from the tables: names, defaults, units, bounds and descriptions stand there once."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.exceptions import InvalidNodeNameException
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter
from rclpy.validate_node_name import validate_node_name

from ...errors import ParameterError, PiezoError, printable
from ...parameter import Row, Setting

Content = TypeVar("Content")


def declare(node: Node, rows: Iterable[Row], prefix: str = "", *, read_only: bool = False) -> None:
    """Declare every row as a ROS parameter with default, description and range.

    Parameters
    ----------
    node : rclpy.node.Node
        Node that gets the parameters.
    rows : iterable of Parameter or Setting
        The table.
    prefix : str
        Put before the names, e.g. ``"model.bouc_wen."``.
    read_only : bool
        Whether they are read only at start; later changes are refused.
    """
    for row in rows:
        value = list(row.value) if isinstance(row.value, tuple) else row.value
        descriptor = describe(row)
        descriptor.read_only = read_only
        node.declare_parameter(prefix + row.name, value, descriptor)


def describe(row: Row) -> ParameterDescriptor:
    """Descriptor of a row: meaning with unit, bounds as range where there are any."""
    if isinstance(row, Setting):
        words = f"one of: {', '.join(row.choices)}" if row.choices else ""
        span = [IntegerRange(from_value=row.lower, to_value=row.upper)] if row.is_number else []
        return ParameterDescriptor(description=row.meaning, additional_constraints=words, integer_range=span)
    ranged = not row.is_array and math.isfinite(row.lower) and math.isfinite(row.upper)
    return ParameterDescriptor(
        description=f"{row.meaning} [{row.unit}]",
        additional_constraints=f"{row.symbol}: {row.lower:g} to {row.upper:g} {row.unit} ({row.source})",
        floating_point_range=[FloatingPointRange(from_value=row.lower, to_value=row.upper)] if ranged else [],
    )


def read(node: Node, rows: Iterable[Row], prefix: str = "") -> dict[str, Any]:
    """Present values of declared rows by name, checked; arrays are tuples.

    Raises
    ------
    ParameterError
        On a value outside its bounds or choices.
    """
    return {row.name: row.check(node.get_parameter(prefix + row.name).value, prefix) for row in rows}


def node_name(parameter: str, value: str) -> str:
    """The value of a parameter that names a node of the same namespace; ParameterError if it is no such name."""
    try:
        validate_node_name(value)
    except InvalidNodeNameException:
        raise ParameterError(
            f"{parameter}: got '{printable(value)}', expected the name of a node, without its namespace"
        ) from None
    return value


def let_change(
    node: Node, rows: Iterable[Row], name: str, load: Callable[[str], Content], changed: Callable[[Content], None]
) -> None:
    """Let the path `name` be changed while the node runs. The other rows cannot be changed after the start.

    Parameters
    ----------
    node : rclpy.node.Node
    rows : iterable of Parameter or Setting
        The declared table.
    name : str
        Row of the path.
    load : callable
        Reads the file before its path is accepted; it raises PiezoError to refuse it.
    changed : callable
        Called with what was read from every accepted file, which is not read again: it may have changed.
    """
    by_name = {row.name: row for row in rows}
    content: list[Content] = []

    def check(parameters: list[RosParameter]) -> SetParametersResult:
        content.clear()
        try:
            for parameter in parameters:
                if parameter.name == name:
                    content.append(load(str(by_name[name].check(parameter.value))))
                elif parameter.name in by_name:
                    raise ParameterError(f"{parameter.name} is read at start; give it then")
        except PiezoError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def apply(parameters: list[RosParameter]) -> None:
        if any(parameter.name == name for parameter in parameters):
            changed(content[-1])

    node.add_on_set_parameters_callback(check)
    node.add_post_set_parameters_callback(apply)
