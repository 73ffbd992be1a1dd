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

"""`FollowedModel`: the newest model, and its run over the voltages that were applied to the stage."""

from __future__ import annotations

from collections.abc import Callable

from std_msgs.msg import String

from ...acquisition.sample_block import SampleBlock
from ...errors import ModelError, PiezoError, StageError
from ...identification.protocol.drive_limits import DriveLimits
from ...model.model import Model
from ...model.model_file import load, loads
from ..runtime.guarded_node import GuardedNode
from ..topics import subscribe
from .applied_state import AppliedState, check_period
from .status import CompensationStatus


class FollowedModel:
    """The model of a file, replaced by every one on the topic `model`.

    The present job ends with the model with which it was planned.

    Parameters
    ----------
    node : GuardedNode
        The compensation node.
    path : str
        File of the first model; empty if there is none.
    status : CompensationStatus
        Reports a model that is refused.
    is_busy : callable
        Whether a job is running.

    Attributes
    ----------
    applied : AppliedState or None
        State of the model after the applied voltages; None before the first samples of a driver that is known.

    Raises
    ------
    PiezoError
        If the file holds no model.
    """

    def __init__(self, node: GuardedNode, path: str, status: CompensationStatus, is_busy: Callable[[], bool]) -> None:
        self._status = status
        self._is_busy = is_busy
        self._newest = load(path) if path else None
        self.applied: AppliedState | None = None
        subscribe(node, "model", self._on_model)

    def take(self, block: SampleBlock, driver: DriveLimits | None) -> None:
        """Run the model over a block of samples of this driver; a model that is refused there is reported.

        Raises
        ------
        RecordError
            On samples that no stage can give.
        """
        if driver is not None and (self.applied is None or self.applied.sample_period != driver.sample_period):
            self.applied = AppliedState(driver.sample_period)
            self.catch_up()
        if self.applied is not None and (refused := self.applied.take(block)):
            rest = "" if self.applied.missing else "; the model before it stays in use"
            self._status.refuse("model", f"{refused}{rest}")

    def ready(self, driver: DriveLimits) -> AppliedState:
        """State from which a plan can start.

        Raises
        ------
        PiezoError
            If there are no samples or no model yet, or the model is of another sample period than the driver or was
            refused on the applied voltages.
        """
        if self.applied is None:
            raise StageError("no samples yet; is the driver active?")
        if self._newest is None:
            raise ModelError("no model yet; expected model_file, or a model on the topic 'model'")
        check_period(self._newest, driver.sample_period)
        if self.applied.missing:
            raise ModelError(self.applied.missing)
        return self.applied

    def catch_up(self) -> None:
        """Use the newest model, after the job during which it may have arrived."""
        if self.applied is not None and self._newest is not None:
            try:
                self.applied.follow(self._newest)
            except PiezoError as error:
                self._status.refuse("model", str(error))

    def _on_model(self, message: String) -> None:
        try:
            self._follow(loads(message.data, "topic 'model'"))
        except PiezoError as error:
            self._status.refuse("model", str(error))

    def _follow(self, model: Model) -> None:
        if self.applied is not None:
            check_period(model, self.applied.sample_period)
            if not self._is_busy():
                self.applied.follow(model)
        self._newest = model
