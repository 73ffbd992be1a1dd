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

"""`ModelDiagnostics`: the model node's line on /diagnostics, once a second."""

from __future__ import annotations

import time
from collections.abc import Iterator

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.clock import Clock, ClockType

from ...acquisition.sample_block import SampleBlock
from ...identification.range_watch import RangeWatch
from ...model.model import Model
from ...model.model_parameters import model_hash
from ...online.predictor import Predictor
from ...record import Notice
from ..messages.conversions import diagnostic, worst
from ..runtime.guarded_node import LOG_INTERVAL, GuardedNode
from ..runtime.sending import send
from ..topics import DIAGNOSTICS, advertise
from .change_reporter import ChangeReporter
from .complaints import Complaints
from .residual_alarm import ResidualAlarm


class ModelDiagnostics:
    """Publishes rate, losses, latency, and the residual with the free-run error of the model file.

    Parameters
    ----------
    node : GuardedNode
        The model node; its full name stands before every status.
    alarm : ResidualAlarm
        Decides when the residual is a warning or an error.
    changes : ChangeReporter
        Its newest status is published as well.
    """

    def __init__(self, node: GuardedNode, alarm: ResidualAlarm, changes: ChangeReporter) -> None:
        self._node, self._alarm, self._changes = node, alarm, changes
        self._name = f"{node.get_fully_qualified_name().lstrip('/')}: prediction"
        self._publisher = advertise(node, DIAGNOSTICS)
        self._complaints = Complaints(node)
        self._frame = ""
        self._model: Model | None = None
        self._predictor: Predictor | None = None
        self._range: RangeWatch | None = None
        self._outside: set[str] = set()
        self._free_run_error: float | None = None
        self._latency = 0.0
        self._seen = (time.monotonic(), 0, 0, 0)
        node.create_timer(1.0, self._publish, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def problem(self, message: str) -> None:
        """Report a problem in one line, now and in the next report."""
        self._complaints.problem(message)

    def refused(self, message: str) -> None:
        """Report why a model was refused, until another model is accepted."""
        self._complaints.refused(message)

    def model(self, model: Model) -> None:
        """Report the model in use from now on."""
        self._model = model
        self._complaints.accepted()
        try:
            self._free_run_error = float(model.provenance["free_run_error"])
        except (KeyError, ValueError):
            self._free_run_error = None
        message = f"model {model_hash(model)}: {', '.join(e.name for e in model.effects)}"
        self._node.get_logger().info(message, throttle_duration_sec=LOG_INTERVAL)

    def follow(self, predictor: Predictor) -> None:
        """Report the counters of a predictor from now on."""
        self._predictor, self._range = predictor, None
        self._seen = (time.monotonic(), 0, 0, 0)

    def saw(self, block: SampleBlock, now: int) -> None:
        """Record the age of a block that was processed at `now` [ns]."""
        self._frame = block.frame
        self._latency = max(self._latency, (now - block.stamp) * 1e-9 - float(block.time[-1]))
        predictor = self._predictor
        if predictor is None or predictor.model is None:
            return
        if self._range is None or self._range.model is not predictor.model:
            self._range = RangeWatch(predictor.model, predictor.sample_period)
        self._range.add(block.voltage)

    def _publish(self) -> None:
        values: dict[str, object] = {"problems": self._complaints.count, "faults": self._node.faults}
        if self._model is not None:
            values["model"] = model_hash(self._model)
        predictor, received = self._predictor, False
        lost = repeated = 0
        if predictor is not None:
            counts, now = predictor.sequence, time.monotonic()
            then, received_then, lost_then, repeated_then = self._seen
            self._seen = (now, counts.received, counts.lost, counts.repeated)
            received = counts.received > received_then
            lost, repeated = counts.lost - lost_then, counts.repeated - repeated_then
            rms = predictor.residual_rms
            values |= {
                "rate": (counts.received - received_then) / (now - then) if now > then else 0.0,
                "received": counts.received,
                "lost": counts.lost,
                "repeated": counts.repeated,
                "restarts": counts.restarts,
                "latency_max": self._latency,
                "offset": predictor.offset,
                "warming_up": predictor.warming_up,
                "swapping": predictor.is_swapping,
                **({} if rms is None else {"residual_rms": rms}),
                **({} if self._free_run_error is None else {"free_run_error": self._free_run_error}),
            }
        findings = list(self._findings(received, lost, repeated)) or [(DiagnosticStatus.OK, "predicting")]
        level, message = worst(*(level for level, _ in findings)), "; ".join(text for _, text in findings)
        self._complaints.shown()
        self._latency = 0.0
        array = DiagnosticArray(
            status=[diagnostic(level, self._name, message, self._frame, **values), self._changes.status]
        )
        array.header.stamp = self._node.get_clock().now().to_msg()
        send(self._publisher, array)

    def _findings(self, received: bool, lost: int, repeated: int) -> Iterator[tuple[bytes, str]]:
        predictor = self._predictor
        yield from self._complaints.findings()
        if fault := self._node.recent_fault:
            yield DiagnosticStatus.ERROR, fault
        if predictor is None or not received:
            yield DiagnosticStatus.STALE, "no samples"
            return
        if lost:
            yield DiagnosticStatus.WARN, f"{lost} samples were lost; the voltage was held constant over the gap"
        if repeated:
            yield DiagnosticStatus.WARN, f"{repeated} samples came more than once or too late and were dropped"
        if predictor.model is None and predictor.is_swapping:
            yield DiagnosticStatus.WARN, "the model is being run over the drive voltages so far"
        elif predictor.model is None and self._model is None:
            yield DiagnosticStatus.WARN, "there is no model; give model_file, or identify the stage"
        elif predictor.model is None:
            yield (
                DiagnosticStatus.ERROR,
                "the model cannot predict: its sample period is too long, or its output diverged",
            )
        if predictor.model is None:
            return
        if predictor.warming_up:
            yield (
                DiagnosticStatus.WARN,
                "the model is warming up, because the earlier drive voltage is unknown",
            )
        for notice in self._outside_range():
            yield DiagnosticStatus.WARN, notice.message
        if (finding := self._alarm.finding(predictor.residual_rms, self._free_run_error)) is not None:
            yield finding

    def _outside_range(self) -> tuple[Notice, ...]:
        """Notices about a drive outside the identified range; each kind is logged when it begins."""
        found = self._range.findings() if self._range else ()
        for notice in found:
            if notice.kind not in self._outside:
                self._node.get_logger().warning(notice.message)
        self._outside = {notice.kind for notice in found}
        return found
