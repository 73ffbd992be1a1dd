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

"""`model_parameters`: a `Model` as a set of ROS parameters, strict and exact.

The same names stand in model files, on the identification node and in a ``ros2 param dump``.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Iterable, Mapping, Sequence

from ..effects import Effect, effect_named
from ..errors import ModelError, ParameterError
from ..parameter import Parameter, Value
from .model import Model
from .parameter_covariance import ParameterCovariance
from .parameter_file import Entry, entry

PREFIX = "model."
"""Prefix of a model among the parameters of a node."""

COVARIANCE = "covariance."
"""Name of the covariance of the parameters, below the prefix."""

SCALES = {
    "sample_period": ("s", "period at which the discrete dynamics hold"),
    "voltage_scale": ("V", "v = u / voltage_scale"),
    "displacement_scale": ("m", "displacement at normalised output 1"),
}
"""Numbers of the model itself: unit and meaning."""


def to_parameters(model: Model, valid: bool = True) -> dict[str, Entry]:
    """The model as ROS parameters.

    Parameters
    ----------
    model : Model
        Model to write.
    valid : bool
        False where the values are only a start, not identified.

    Returns
    -------
    dict
        Names with the prefix ``model.`` to bool, float, str or non-empty lists of them. ROS has no typed empty array:
        an empty array parameter is left out, and a missing one reads as empty.

    Raises
    ------
    ModelError
        If a provenance key is no lower-case identifier, or the chain is empty.
    """
    if not model.effects:
        raise ModelError("model: got an empty chain, expected at least one effect")
    named: dict[str, Entry] = {"valid": valid, "hash": model_hash(model), **_content(model)}
    for key, text in model.provenance.items():
        if not re.fullmatch(r"[a-z][a-z0-9_]*", key):
            raise ModelError(f"provenance: got the key {key!r}, expected lower-case letters, digits and '_'")
        named[f"provenance.{key}"] = _number_or_text(text)
    known = model.covariance
    if known is not None and known.factor:
        named |= {COVARIANCE + "names": list(known.names), COVARIANCE + "factor": list(known.factor)}
    return {PREFIX + name: value for name, value in named.items()}


def from_parameters(values: Mapping[str, object], source: str = "model") -> Model:
    """The model in a set of ROS parameters; names without the prefix ``model.`` are ignored.

    Parameters
    ----------
    values : mapping
        Parameter name to value, as from `to_parameters` or a node.
    source : str
        Name of the set in messages.

    Raises
    ------
    ModelError
        On a missing or unknown name, a wrong type, ``model.valid: false`` or a hash that does not fit the values.
    ParameterError
        On a value outside its bounds.
    """
    own = {name.removeprefix(PREFIX): value for name, value in values.items() if name.startswith(PREFIX)}
    if not own:
        raise ModelError(f"{source}: got no parameter under '{PREFIX}', expected {PREFIX}effects and its values")
    if own.pop("valid", True) is not True:
        raise ModelError(f"{source}: model.valid is not true: these are start values; identify the stage first")
    expected_hash = own.pop("hash", None)
    provenance = {k.removeprefix("provenance."): own.pop(k) for k in list(own) if k.startswith("provenance.")}
    names = _texts(_take(own, "effects", source), "effects", "effect names", source)
    covariance = _covariance(own, source)
    scales = {name: _float(_take(own, name, source), name, unit, source) for name, (unit, _) in SCALES.items()}
    effects = tuple(_effect(n, own, source) for n in names)
    if own:
        raise ModelError(f"{source}: got unknown 'model.{min(own)}', expected only values of {', '.join(names)}")
    try:
        model = Model(effects, **scales, provenance={k: _text(v) for k, v in provenance.items()}, covariance=covariance)
    except ModelError as error:
        raise ModelError(f"{source}: {error}") from None
    if expected_hash is not None and expected_hash != model_hash(model):
        raise ModelError(
            f"{source}: model.hash is {expected_hash}, the values give {model_hash(model)}: something was changed or "
            "lost; delete model.hash to accept the values as they are"
        )
    return model


def model_hash(model: Model) -> str:
    """``sha256:`` and 16 digits of everything that a prediction depends on, so without provenance and covariance."""
    content = "\n".join(f"{name}: {entry(value)}" for name, value in sorted(_content(model).items()))
    return "sha256:" + hashlib.sha256(content.encode()).hexdigest()[:16]


def hash_number(model: Model) -> int:
    """The first 32 bits of the hash, as `predicted_samples` carries them."""
    return first_bits(model_hash(model))


def first_bits(content_hash: str) -> int:
    """The first 32 bits of a hash that begins with ``sha256:``."""
    return int(content_hash.removeprefix("sha256:")[:8], 16)


def _content(model: Model) -> dict[str, Entry]:
    content: dict[str, Entry] = {"effects": [e.name for e in model.effects]}
    content |= {name: float(getattr(model, name)) for name in SCALES}
    for effect in model.effects:
        for name, value in effect.values.items():
            if value != ():
                content[f"{effect.name}.{name}"] = list(value) if isinstance(value, tuple) else value
    return content


def _effect(effect: str, own: dict[str, object], source: str) -> Effect:
    try:
        kind = effect_named(effect)
    except ModelError as error:
        raise ModelError(f"{source}: model.effects: {error}") from None
    values: dict[str, Value] = {}
    for row in kind.parameters:
        name = f"{kind.name}.{row.name}"
        if row.is_array:
            values[row.name] = _floats(own.pop(name, ()), name, row, source)
        else:
            values[row.name] = _float(_take(own, name, source), name, row.unit, source)
    try:
        return kind(**values)
    except ParameterError as error:
        raise ParameterError(f"{source}: model.{error}") from None


def _covariance(own: dict[str, object], source: str) -> ParameterCovariance | None:
    if COVARIANCE + "names" not in own and COVARIANCE + "factor" not in own:
        return None
    key = COVARIANCE + "names"
    names = _texts(_take(own, key, source), key, "names of numbers", source)
    key = COVARIANCE + "factor"
    values = _take(own, key, source)
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise ModelError(f"{source}: model.{key}: got {values!r}, expected a list of numbers")
    factor = [_float(v, f"{key}[{i}]", "in the units of the numbers", source) for i, v in enumerate(values)]
    try:
        return ParameterCovariance(tuple(names), tuple(factor))
    except ModelError as error:
        raise ModelError(f"{source}: {error}") from None


def _texts(values: object, name: str, expected: str, source: str) -> Sequence[str]:
    if not isinstance(values, Sequence) or isinstance(values, str) or not all(isinstance(v, str) for v in values):
        raise ModelError(f"{source}: model.{name}: got {values!r}, expected a list of {expected}")
    return values


def _take(own: dict[str, object], name: str, source: str) -> object:
    if name not in own:
        raise ModelError(f"{source}: 'model.{name}' is missing, expected every value of the model")
    return own.pop(name)


def _float(value: object, name: str, unit: str, source: str) -> float:
    if isinstance(value, float):
        return value
    hint = f"; write {value}.0, ROS keeps integers apart" if type(value) is int else ""
    raise ModelError(f"{source}: model.{name}: got {value!r}, expected a number [{unit}] with a decimal point{hint}")


def _floats(values: object, name: str, row: Parameter, source: str) -> tuple[float, ...]:
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise ModelError(f"{source}: model.{name}: got {values!r}, expected a list of numbers [{row.unit}]")
    return tuple(_float(v, f"{name}[{i}]", row.unit, source) for i, v in enumerate(values))


def _number_or_text(text: str) -> float | str:
    """A text that looks like a number becomes a number: PyYAML writes the text 1e-05 so that rcl reads a double."""
    try:
        value = float(text)
    except ValueError:
        return text
    return value if math.isfinite(value) and repr(value) == text else text


def _text(value: object) -> str:
    return repr(value) if isinstance(value, float) else str(value)
