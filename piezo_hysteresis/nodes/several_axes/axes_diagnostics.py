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

"""`AxesDiagnostics`: the line of the model node of several axes on /diagnostics, once a second."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.clock import Clock, ClockType

from ...acquisition.sample_block import SampleBlock
from ...model.axes_file import content_hash
from ...online.axes_joiner import AxesJoiner
from ...online.axes_predictor import AxesPredictor
from ..messages.conversions import diagnostic, worst
from ..model.complaints import Complaints
from ..model.residual_alarm import ResidualAlarm
from ..runtime.guarded_node import GuardedNode
from ..runtime.sending import send
from ..topics import DIAGNOSTICS, advertise

LONGEST_SILENCE = 1.0
"""Time without a block after which a stream is reported [s]."""

LEVEL_TOLERANCE = 0.05
"""Share by which the drives may exceed the identified level before they are reported."""


class AxesDiagnostics:
    """Publishes rate, losses, latency, and every residual with the free-run error of the model file.

    Parameters
    ----------
    node : GuardedNode
        The model node; its full name stands before the status.
    streams : sequence of str
        Namespaces of the streams.
    values : mapping
        Values of the parameters of the node, by name.
    """

    def __init__(self, node: GuardedNode, streams: Sequence[str], values: Mapping[str, Any]) -> None:
        self._node, self._streams, self._alarm = node, streams, ResidualAlarm(values)
        self._name = f"{node.get_fully_qualified_name().lstrip('/')}: prediction"
        self._publisher = advertise(node, DIAGNOSTICS)
        self._complaints = Complaints(node)
        self._newest = [-math.inf] * len(streams)
        self._joiner: AxesJoiner | None = None
        self._predictor: AxesPredictor | None = None
        self._latency = self._level = 0.0
        self._frame, self._joinings = "", 0
        self._seen: tuple[float, tuple[int, ...]] = (time.monotonic(), (0, 0, 0))
        node.create_timer(1.0, self._publish, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def problem(self, message: str) -> None:
        """Report a problem in one line, now and in the next report."""
        self._complaints.problem(message)

    def refused(self, message: str) -> None:
        """Report why a model was refused, until another model is accepted."""
        self._complaints.refused(message)

    def follow(self, joiner: AxesJoiner, predictor: AxesPredictor) -> None:
        """Report the counters of a joiner and a predictor from now on."""
        self._complaints.accepted()
        self._joiner, self._predictor, self._joinings = joiner, predictor, 0
        self._seen = (time.monotonic(), (0, 0, 0))
        model = predictor.model
        self._node.get_logger().info(
            f"model {content_hash(model)}: {model.inputs} drives, {model.outputs} displacements"
        )

    def reached(self, level: float) -> None:
        """Record the running rms of the drives after a block [V]."""
        self._level = max(self._level, level)

    def saw(self, stream: int, block: SampleBlock, now: int) -> None:
        """Record the age of a block that arrived at `now` [ns]."""
        self._newest[stream] = time.monotonic()
        self._frame = block.frame
        self._latency = max(self._latency, (now - block.stamp) * 1e-9 - float(block.time[-1]))

    def _publish(self) -> None:
        values: dict[str, object] = {"problems": self._complaints.count}
        new: tuple[int, ...] = (0, 0, 0)
        if self._joiner is not None and self._predictor is not None:
            joiner, predictor, now = self._joiner, self._predictor, time.monotonic()
            counts = joiner.joined, joiner.lost, joiner.repeated
            then, before = self._seen
            new = tuple(count - earlier for count, earlier in zip(counts, before, strict=True))
            self._seen = (now, counts)
            self._joinings += len(joiner.moves)
            values |= {
                "model": content_hash(predictor.model),
                "rate": new[0] / (now - then) if now > then else 0.0,
                "received": joiner.joined,
                "lost": joiner.lost,
                "repeated": joiner.repeated,
                "rejoined": self._joinings,
                "latency_max": self._latency,
                "warming_up": predictor.warming_up,
                "drive_rms": self._level,
            }
            for quantity, of_axes in (
                ("offset", predictor.offset),
                ("residual_rms", predictor.residual_rms),
                ("free_run_error", predictor.model.free_run_error),
            ):
                named = {f"{quantity}_{n}" if n > 1 else quantity: value for n, value in enumerate(of_axes, 1)}
                values |= {name: value for name, value in named.items() if value is not None}
        findings = list(self._findings(*new)) or [(DiagnosticStatus.OK, "predicting")]
        level, message = worst(*(level for level, _ in findings)), "; ".join(text for _, text in findings)
        self._latency = self._level = 0.0
        self._complaints.shown()
        send(self._publisher, self._node.reported(diagnostic(level, self._name, message, self._frame, **values)))

    def _findings(self, joined: int, lost: int, repeated: int) -> Iterator[tuple[bytes, str]]:
        yield from self._complaints.findings()
        silent = [
            name
            for name, newest in zip(self._streams, self._newest, strict=True)
            if time.monotonic() - newest > LONGEST_SILENCE
        ]
        if silent:
            yield DiagnosticStatus.STALE, f"no samples of {', '.join(silent)}"
        if lost:
            yield DiagnosticStatus.WARN, f"{lost} samples were lost; the voltages were held constant over the gap"
        if repeated:
            yield DiagnosticStatus.WARN, f"{repeated} samples came more than once or too late and were dropped"
        predictor, joiner = self._predictor, self._joiner
        if predictor is None or joiner is None:
            yield DiagnosticStatus.WARN, "there is no model; set model_file"
            return
        for stream, move in joiner.moves:
            yield (
                DiagnosticStatus.WARN,
                f"the stamps of {self._streams[stream]} moved by {move:.3g} s; all axes were joined anew",
            )
        joiner.moves.clear()
        if silent:
            return
        if not joined:
            if not self._complaints.has_problems:  # otherwise the samples were refused, whatever the clocks are
                apart = f"the newest are {joiner.apart:.3g} s apart; set the clocks to one time"
                yield DiagnosticStatus.STALE, f"no samples of the same time, {apart}"
            return
        if predictor.warming_up:
            yield DiagnosticStatus.WARN, "the model is warming up, because the earlier drive voltages are unknown"
        if self._level > (1.0 + LEVEL_TOLERANCE) * predictor.model.level_max:
            yield (
                DiagnosticStatus.WARN,
                f"the drives reach {self._level:.3g} V rms, the model was identified up to "
                f"{predictor.model.level_max:.3g} V",
            )
        for number, (rms, error) in enumerate(
            zip(predictor.residual_rms, predictor.model.free_run_error, strict=False), 1
        ):
            if (finding := self._alarm.finding(rms, float(error))) is not None:
                yield finding[0], f"displacement {number}: {finding[1]}"
