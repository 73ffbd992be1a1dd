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

"""`DriverParameters`: the ROS parameters of the driver, and which of them may be changed."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from ...acquisition.safety.stop_latch import StopLatch
from ...acquisition.settings import DRIVER, IN_FORCE
from ...errors import ParameterError
from ...stage.back_ends import BACK_ENDS
from ..runtime.parameters import declare

_SIMULATED_TIME = "use_sim_time"
"""Parameter of every ROS node: its clock follows /clock."""

_OWN_CLOCK = "a driver stamps samples and checks commands by the clock of the computer"
"""Reason why a driver refuses this parameter."""

_PREFIX = "in_force."
"""Before the names of the parameters that show the values in use."""

_OWN = {row.name for row in DRIVER}
"""Parameters of the driver itself."""


def refuse_simulated_time(node: Node) -> None:
    """Check that the clock of this driver is the one of the computer.

    Raises
    ------
    ParameterError
        If `use_sim_time` is set.
    """
    if node.get_parameter(_SIMULATED_TIME).value:
        raise ParameterError(f"{_SIMULATED_TIME}: got true, expected false; {_OWN_CLOCK}")


class DriverParameters:
    """Declares the parameters of the driver and of all its stages, and those under ``in_force.``.

    Parameters
    ----------
    node : rclpy.node.Node
        The driver.
    latch : StopLatch
        Latch of the driver, which is shown as ``in_force.stopped``.
    is_configured : callable
        Whether the driver has its stage. The parameters are read before that, so that a change would have no effect.
    """

    def __init__(self, node: Node, latch: StopLatch, is_configured: Callable[[], bool]) -> None:
        self._node = node
        self._latch = latch
        self._is_configured = is_configured
        self._is_ours = False
        declare(node, DRIVER)
        for word, back_end in BACK_ENDS.items():
            declare(node, back_end.rows, f"{word}.")
        declare(node, IN_FORCE, _PREFIX)
        node.add_on_set_parameters_callback(self._refuse)

    def publish_in_force(self, values: Mapping[str, object]) -> None:
        """Show these values, by name, as those in use."""
        self._is_ours = True
        try:
            self._node.set_parameters([Parameter(_PREFIX + name, value=value) for name, value in values.items()])
        finally:
            self._is_ours = False

    def clear_in_force(self) -> None:
        """Show that no stage is in use, and whether the driver was stopped."""
        self.publish_in_force({row.name: row.value for row in IN_FORCE} | {"stopped": self._latch.is_set})

    def _refuse(self, parameters: list[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            reason = self._why_not(parameter.name)
            if reason:
                return SetParametersResult(successful=False, reason=reason)
        return SetParametersResult(successful=True)

    def _why_not(self, name: str) -> str:
        """Why a parameter cannot be changed now; empty if it can."""
        if name == _SIMULATED_TIME:
            return f"{name}: {_OWN_CLOCK}"
        if name.startswith(_PREFIX):
            return "" if self._is_ours else f"{name} is read only{_instead(name.removeprefix(_PREFIX))}"
        is_own = name in _OWN or name.split(".")[0] in BACK_ENDS
        if is_own and self._is_configured():
            return (
                f"{name} is read when the driver is configured; deactivate and clean up the driver, set it, "
                "and configure again"
            )
        return ""


def _instead(name: str) -> str:
    """What changes a value in use, as the end of a sentence; nothing where the stage alone determines it."""
    if name == "stopped":
        return "; call ~/stop or ~/release instead"
    return f"; set {name} instead" if name in _OWN else ""
