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

"""`parameter_file`: ROS 2 parameter YAML, read as rcl reads it and written so that rcl and PyYAML agree.

The two disagree on numbers: ``1e-05`` is a double to rcl and a string to PyYAML, and ``3`` never becomes a double.
Therefore numbers are written with a decimal point, texts are always quoted, and files are read by rcl's rules.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

import yaml

from ..errors import ParameterError

Scalar = bool | int | float | str
Entry = Scalar | list[Scalar]

_TRUE = {"y", "Y", "yes", "Yes", "YES", "true", "True", "TRUE", "on", "On", "ON"}
"""Words that rcl reads as true."""
_FALSE = {"n", "N", "no", "No", "NO", "false", "False", "FALSE", "off", "Off", "OFF"}
"""Words that rcl reads as false."""
_INTEGER = re.compile(r"[-+]?(0[xX][0-9a-fA-F]{1,15}|[0-9]{1,18})")  # longer ones are doubles to rcl
"""Texts that rcl reads as an integer."""
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+\.?[0-9]*)([eE][-+]?[0-9]+)?")
"""Texts that rcl reads as a double."""
_SPECIAL = re.compile(r"([-+]?)\.(inf|Inf|INF|nan|NaN|NAN)")
"""Texts that rcl reads as infinity, or as not a number."""


LONGEST_TEXT = 1_000_000
"""Largest number of characters of a parameter file: parsing it takes a hundred times as much memory, and a second."""
_DEEPEST = 20
"""Largest number of levels of a parameter file; the time of parsers grows with its square."""
_MOST_EVENTS = 50_000
"""Largest number of keys, values and brackets of a parameter file: while a node reads it, samples wait."""
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""The parser in C, ten times faster, where PyYAML was built with it."""


def number(value: float) -> str:
    """A float that reads back bit for bit and is a float to every reader.

    >>> number(1e-05), number(3.0), number(0.1)
    ('1.0e-05', '3.0', '0.1')
    """
    text = repr(float(value))
    mantissa, exponent, power = text.partition("e")
    return text if "." in mantissa or not exponent else f"{mantissa}.0e{power}"


def quoted(text: str) -> str:
    """A text in double quotes, on one line."""
    return yaml.safe_dump(text, default_style='"', width=math.inf, allow_unicode=True).rstrip("\n")


def entry(value: Entry) -> str:
    """Any parameter value as YAML on one line.

    >>> entry([1.0, 1e-9]), entry(True), entry("a b")
    ('[1.0, 1.0e-09]', 'true', '"a b"')
    """
    if isinstance(value, list):
        return f"[{', '.join(entry(v) for v in value)}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return number(value)
    return quoted(value) if isinstance(value, str) else str(value)


def parameters(text: str, source: str = "parameter file") -> dict[str, dict[str, Entry]]:
    """Parameters of every node in a file, names joined by points.

    Parameters
    ----------
    text : str
        YAML.
    source : str
        Name of the file in messages.

    Returns
    -------
    dict
        Node key (``"/**"``, ``"/stage_x/identification_node"``) to parameter names to values.

    Raises
    ------
    ParameterError
        If the text is no YAML, too long, uses aliases, gives a parameter twice, or holds no ``ros__parameters``.

    Examples
    --------
    >>> parameters("/**: {ros__parameters: {rate: 1e3, x: {y: [a, b]}}}")
    {'/**': {'rate': 1000.0, 'x.y': ['a', 'b']}}
    """
    if len(text) > LONGEST_TEXT:
        raise ParameterError(f"{source}: got more than {LONGEST_TEXT} characters, expected a ROS 2 parameter file")
    try:
        _require_plain(text, source)
        root = yaml.compose(text, Loader=_LOADER)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f" in line {mark.line + 1}" if mark else ""
        problem = getattr(error, "problem", None) or "not a text"
        raise ParameterError(f"{source}: broken YAML{where}: {problem}; expected a ROS 2 parameter file") from None
    except UnicodeError:
        raise ParameterError(f"{source}: not a text in UTF-8, expected a ROS 2 parameter file") from None
    found: dict[str, dict[str, Entry]] = {}
    for node, mapping in _nodes(root, ""):
        into = found.setdefault(node, {})
        for name, value in _flat(mapping, "", source):
            if name in into:
                raise ParameterError(f"{source}: '{name}' is given twice for {node}, expected each parameter once")
            into[name] = value
    if not found:
        raise ParameterError(f"{source}: got no 'ros__parameters', expected a ROS 2 parameter file keyed '/**'")
    return found


def _require_plain(text: str, source: str) -> None:
    """Refuse deep or long files and, as rcl does, aliases: a few nested aliases can stand for a text of any length."""
    depth = 0
    for number, event in enumerate(yaml.parse(text, Loader=_LOADER)):
        if number > _MOST_EVENTS:
            raise ParameterError(f"{source}: got more than {_MOST_EVENTS} entries, expected a ROS 2 parameter file")
        if isinstance(event, yaml.AliasEvent):
            raise yaml.composer.ComposerError(None, None, "got an alias, which ROS does not read", event.start_mark)
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
            if depth > _DEEPEST:
                raise ParameterError(f"{source}: nested too deeply, expected a ROS 2 parameter file")
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1


def _nodes(node: yaml.Node | None, path: str, depth: int = 0) -> Iterator[tuple[str, yaml.MappingNode]]:
    if not isinstance(node, yaml.MappingNode) or depth > 8:
        return
    for key, value in node.value:
        if key.value == "ros__parameters" and isinstance(value, yaml.MappingNode):
            yield path, value
        elif isinstance(key, yaml.ScalarNode):
            yield from _nodes(value, f"{path}/{key.value}" if path else key.value, depth + 1)


def _flat(mapping: yaml.MappingNode, prefix: str, source: str) -> Iterator[tuple[str, Entry]]:
    if prefix.count(".") > 8:
        raise ParameterError(f"{source}: '{prefix}' is nested too deeply, expected a ROS 2 parameter file")
    for key, value in mapping.value:
        if not isinstance(key, yaml.ScalarNode):
            raise ParameterError(f"{source}: line {key.start_mark.line + 1} has a key that is no parameter name")
        name = prefix + key.value
        if isinstance(value, yaml.MappingNode):
            yield from _flat(value, name + ".", source)
        elif isinstance(value, yaml.SequenceNode):
            if not all(isinstance(item, yaml.ScalarNode) for item in value.value):
                raise ParameterError(f"{source}: '{name}' holds a list of lists, expected a list of numbers or texts")
            yield name, [_scalar(item) for item in value.value]
        else:
            yield name, _scalar(value)


def _scalar(node: yaml.ScalarNode) -> Scalar:
    text: str = node.value
    if node.style in ("'", '"', "|", ">"):
        return text
    if text in _TRUE:
        return True
    if text in _FALSE:
        return False
    if _INTEGER.fullmatch(text):
        return int(text, 0) if "x" in text.lower() else int(text)
    if _FLOAT.fullmatch(text):
        return float(text)
    special = _SPECIAL.fullmatch(text)
    return float(special[1] + special[2]) if special else text
