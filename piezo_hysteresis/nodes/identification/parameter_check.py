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

"""`ParameterCheck`: decides which changes of its parameters the identification node accepts."""

from __future__ import annotations

from collections.abc import Callable

from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter

from ...errors import ParameterError, PiezoError
from ...model.model_parameters import PREFIX
from ..topics import QOS_OVERRIDES
from .experiment_folder import ExperimentFolder
from .settings import IDENTIFICATION


class ParameterCheck:
    """Called by rclpy before parameters change.

    Parameters
    ----------
    folder : ExperimentFolder
        Folder in which recordings have to be.
    is_declared : callable
        Whether the node has a parameter of this name.
    """

    def __init__(self, folder: ExperimentFolder, is_declared: Callable[[str], bool]) -> None:
        self._folder, self._is_declared = folder, is_declared

    def __call__(self, parameters: list[Parameter]) -> SetParametersResult:
        rows = {row.name: row for row in IDENTIFICATION}
        try:
            for parameter in parameters:
                if parameter.name in rows:
                    rows[parameter.name].check(parameter.value)
                    self._check_place(parameter)
                elif parameter.name.startswith(QOS_OVERRIDES):
                    continue  # declared when a recording subscribes, after the start
                elif not (parameter.name.startswith(PREFIX) or self._is_declared(parameter.name)):
                    raise ParameterError(f"{parameter.name} is no parameter of this node, expected {', '.join(rows)}")
        except PiezoError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _check_place(self, parameter: Parameter) -> None:
        """Refuse folders outside the experiment root, because a diagnosis writes files beside its recording."""
        if parameter.name in ("driver", "experiment_root"):
            raise ParameterError(f"{parameter.name} is read at start; give it then")
        if parameter.name == "experiment" and parameter.value:
            self._folder.check(parameter.value)
