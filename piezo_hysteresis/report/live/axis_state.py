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

"""`AxisState`: samples, statuses and models of a running axis, written by nodes and read by pages."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field

from ...changes.recalibration_history import RecalibratedNumber, read_numbers
from ...errors import PiezoError
from ...model.model import Model
from ...model.model_file import loads
from ...model.model_parameters import model_hash
from .sample_window import SampleWindow

OK, WARN, ERROR, STALE = range(4)
"""Levels of a status, as in diagnostic_msgs/DiagnosticStatus."""

HISTORY = 20
"""Number of models, and of alarms, that are kept."""

SILENT = 3.0
"""Time without a message after which a node counts as ended [s]; this is three reports on /diagnostics."""


@dataclass(frozen=True, slots=True)
class Status:
    """One status of a node.

    Parameters
    ----------
    name : str
        Name of the node and, after a colon, the subject of the report.
    level : int
        `OK`, `WARN`, `ERROR` or `STALE`.
    message : str
        Its message.
    values : mapping of str to str
        Its values.
    received : float
        Time of arrival on the steady clock [s].
    """

    name: str
    level: int
    message: str
    values: Mapping[str, str] = field(default_factory=dict)
    received: float = field(default_factory=time.monotonic)

    @property
    def age(self) -> float:
        """Time since its arrival [s]."""
        return time.monotonic() - self.received


@dataclass(frozen=True, slots=True)
class Alarm:
    """A status that was worse than OK, with its time.

    Parameters
    ----------
    name, message : str
        As in the status that raised it.
    level : int
        The worst level so far.
    began : float
        Time since the epoch [s].
    """

    name: str
    message: str
    level: int
    began: float


@dataclass(frozen=True, slots=True)
class KnownModel:
    """A model that was received on the topic `model`.

    Parameters
    ----------
    model : Model
        The model itself.
    hash : str
        Hash of everything but its provenance.
    received : float
        Time of arrival since the epoch [s].
    """

    model: Model
    hash: str
    received: float

    @property
    def free_run_error(self) -> float | None:
        """RMS of its free-run error on the fitted data [m]; None where the model does not state it."""
        try:
            return float(self.model.provenance["free_run_error"])
        except (KeyError, ValueError):
            return None


class AxisState:
    """One axis.

    Every attribute is replaced as a whole, so that another thread may read it at any time.

    Parameters
    ----------
    name : str
        Namespace of the axis, ``/`` for none.

    Attributes
    ----------
    window : SampleWindow
        Its newest samples.
    heard : float
        Arrival of the last block of samples on the steady clock [s].
    phase : str
        Name of the present phase.
    residual_rms : float or None
        RMS residual over the last second [m].
    statuses : dict of str to Status
        Newest report of every part of every node, by name.
    identification, change : Status or None
        Newest messages of `status` and of `change`.
    verdict : str
        Result of the last diagnosis; empty before there is one.
    models : tuple of KnownModel
        The newest last.
    recalibrations : tuple of RecalibratedNumber
        Recalibrations by the model node, the oldest first.
    refused_model : str
        Reason why the newest text on `model` is not a model; empty where it is one.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.window = SampleWindow()
        self.heard = float("-inf")
        self.phase = ""
        self.residual_rms: float | None = None
        self.statuses: dict[str, Status] = {}
        self.identification: Status | None = None
        self.change: Status | None = None
        self.verdict = ""
        self.models: tuple[KnownModel, ...] = ()
        self.recalibrations: tuple[RecalibratedNumber, ...] = ()
        self.refused_model = ""
        self._active: dict[str, Alarm] = {}
        self._over: deque[Alarm] = deque(maxlen=HISTORY)

    @property
    def is_streaming(self) -> bool:
        """True while samples arrive."""
        return time.monotonic() - self.heard < SILENT

    @property
    def model(self) -> KnownModel | None:
        """The newest model."""
        return self.models[-1] if self.models else None

    @property
    def free_run_error(self) -> float | None:
        """RMS error that the model in use states [m]; None where it states none."""
        prediction = self.part("prediction")
        try:
            return None if prediction is None else float(prediction.values["free_run_error"])
        except (KeyError, ValueError):
            return None

    def part(self, word: str) -> Status | None:
        """The report about ``stage``, ``prediction``, ``identification`` or ``change``; None before it arrives."""
        return next((s for name, s in list(self.statuses.items()) if name.endswith(f": {word}")), None)

    def report(self, status: Status) -> None:
        """Add a report of /diagnostics. A report worse than OK raises an alarm, and the next good one ends it."""
        self.statuses = {**self.statuses, status.name: status}
        active = dict(self._active)
        before = active.get(status.name)
        if status.level in (WARN, ERROR):
            began = time.time() if before is None else before.began
            worst = max(status.level, OK if before is None else before.level)
            active[status.name] = Alarm(status.name, status.message, worst, began)
        elif before is not None:
            self._over.append(active.pop(status.name))
        self._active = active

    @property
    def alarms(self) -> tuple[Alarm, ...]:
        """Present alarms, the newest first."""
        return tuple(sorted(self._active.values(), key=lambda alarm: -alarm.began))

    @property
    def past_alarms(self) -> tuple[Alarm, ...]:
        """Alarms that are over, the newest first."""
        return tuple(reversed(list(self._over)))

    def report_identification(self, status: Status) -> None:
        """Add a message of `status`."""
        self.identification = status
        if status.values.get("conclusion"):
            self.verdict = status.message

    def report_recalibrations(self, text: str) -> None:
        """Replace the history of recalibrations; an invalid text does not change it.

        Raises
        ------
        RecordingError
            If the text is not a history.
        """
        self.recalibrations = read_numbers(text, "topic 'recalibrations'")

    def follow(self, text: str) -> None:
        """Add a model file. The reason why a file is not a model is kept in `refused_model`."""
        try:
            model = loads(text, "topic 'model'")
        except PiezoError as error:
            self.refused_model = str(error)
            return
        self.refused_model = ""
        known = KnownModel(model, model_hash(model), time.time())
        if self.model is None or self.model.hash != known.hash:
            self.models = (*self.models, known)[-HISTORY:]
