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

"""`ServedModel`: publishes the identified model as parameters of the node and on the topic `model`."""

from __future__ import annotations

from collections.abc import Mapping

from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import String

from ...errors import ModelError, PiezoError
from ...model.model import Model
from ...model.model_file import dumps, loads
from ...model.model_parameters import PREFIX, SCALES, from_parameters, to_parameters
from ..runtime.parameters import describe
from ..runtime.sending import send
from ..topics import advertise, subscribe


class ServedModel:
    """Parameters under ``model.``, all declared with values. A fit changes them in one step and is published.

    A model that the model node has recalibrated is published too, so that late joiners receive it.

    Parameters
    ----------
    node : rclpy.node.Node
        Node with ``allow_undeclared_parameters``, because another chain has other names.
    start : Model
        Values to declare before there is a model; not valid.

    Attributes
    ----------
    model : Model or None
        The present model; None while ``model.valid`` is false.
    """

    def __init__(self, node: Node, start: Model) -> None:
        self._node = node
        self._is_ours = False
        self._models = advertise(node, "model")
        self.model: Model | None = None
        self._set(start, valid=False)
        node.add_on_set_parameters_callback(self._refuse)
        subscribe(node, "recalibrated_model", self._on_recalibrated)

    def resume(self, given: Mapping[str, object]) -> None:
        """Publish the model that was given at start, if there is one.

        Parameters
        ----------
        given : mapping
            Parameters by name. The parameters of a dump before any fit are not valid and are ignored.

        Raises
        ------
        ModelError, ParameterError
            If they do not describe a model.
        """
        own = {name: value for name, value in given.items() if name.startswith(PREFIX)}
        if own and own.get(PREFIX + "valid", True) is not False:
            self.serve(from_parameters(own, "parameters given at start"))

    def serve(self, model: Model) -> None:
        """Replace the whole model in one step, and publish it.

        Raises
        ------
        ModelError
            If a parameter is refused. The model is then unchanged.
        """
        self._set(model, valid=True)
        self.model = model
        send(self._models, String(data=dumps(model)))

    def _on_recalibrated(self, message: String) -> None:
        try:
            self.serve(loads(message.data, "topic 'recalibrated_model'"))
        except PiezoError as error:
            self._node.get_logger().warning(str(error), throttle_duration_sec=1.0)

    def _set(self, model: Model, valid: bool) -> None:
        named = to_parameters(model, valid=valid)
        # a parameter without a type is removed
        gone = [name for name in self._node.get_parameters_by_prefix(PREFIX[:-1]) if PREFIX + name not in named]
        changes = [Parameter(PREFIX + name) for name in gone]
        changes += [Parameter(name, value=value) for name, value in named.items()]
        self._is_ours = True
        try:
            result = self._node.set_parameters_atomically(changes)
            if not result.successful:
                raise ModelError(f"parameters under '{PREFIX}': {result.reason}")
            for name in named:
                self._node.set_descriptor(name, _descriptor(name, model))
        finally:
            self._is_ours = False

    def _refuse(self, parameters: list[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            if parameter.name.startswith(PREFIX) and not self._is_ours:
                reason = f"{parameter.name} is a result; give a model file at start, or identify the stage"
                return SetParametersResult(successful=False, reason=reason)
        return SetParametersResult(successful=True)


def _descriptor(name: str, model: Model) -> ParameterDescriptor:
    short = name.removeprefix(PREFIX)
    owner, _, _ = short.partition(".")
    if owner in model:
        descriptor = describe(model.row(short))
    elif short in SCALES:
        unit, meaning = SCALES[short]
        descriptor = ParameterDescriptor(description=f"{meaning} [{unit}]")
    else:
        descriptor = ParameterDescriptor(description="result of the identification")
    descriptor.dynamic_typing = True
    return descriptor
