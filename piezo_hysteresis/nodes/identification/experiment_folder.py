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

"""`ExperimentFolder`: the folder of the recordings of the identification node, and the choice of one of them."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

from ...errors import ParameterError, PiezoError
from ...home_path import in_home
from ...model.model import Model
from ...model.model_file import save


class ExperimentFolder:
    """Folder of the recordings of one axis.

    Parameters
    ----------
    root : str
        Parameter `experiment_root`; empty for the default.
    namespace : str
        Namespace of the node, which the default contains.

    Attributes
    ----------
    last : Path or None
        The newest recording of this node.
    """

    def __init__(self, root: str, namespace: str) -> None:
        self.root = in_home(root or Path("~/.ros/piezo_hysteresis") / namespace.strip("/"))
        self.last: Path | None = None

    def new(self) -> Path:
        """Path of a new recording, named by the time (UTC)."""
        return self.root / datetime.now(UTC).strftime("%Y%m%dT%H%M%S%fZ")

    def chosen(self, given: str) -> Path | None:
        """The recording at this path. An empty path gives the last recording, or None if there is none."""
        if given or self.last is not None:
            return in_home(given) if given else self.last
        recorded = sorted(path.parent for path in self.root.glob("*/metadata.yaml"))
        return recorded[-1] if recorded else None

    def check(self, given: str) -> None:
        """Refuse a path outside the folder, because a diagnosis writes files beside its recording.

        Raises
        ------
        ParameterError
            If there is no such recording.
        """
        root, place = self.root.resolve(), in_home(given).resolve()
        if not (place.is_relative_to(root) and place.exists()):
            raise ParameterError(f"experiment: got {place}, expected a recording inside {root}")


def problem_of_saving(model: Model, path: Path) -> str:
    """Save a model that is served already; returns what is said if that fails, and nothing otherwise."""
    try:
        save(model, path)
    except PiezoError as error:
        return f" The model is served, but not kept: {error}"
    return ""
