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

"""The line of the driver on /diagnostics has the worst of its levels, and tells everything that is wrong."""

from types import SimpleNamespace

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.clock import Clock

from piezo_hysteresis.acquisition.playback import Playback
from piezo_hysteresis.acquisition.safety.keeper_link import NoKeeper
from piezo_hysteresis.acquisition.safety.stop_latch import StopLatch
from piezo_hysteresis.acquisition.sample_block import Tally
from piezo_hysteresis.nodes.driver import diagnostics

pytestmark = pytest.mark.nodes


@pytest.fixture
def reported(monkeypatch):
    """The statuses that were sent."""
    sent = []
    monkeypatch.setattr(diagnostics, "advertise", lambda node, name: None)
    monkeypatch.setattr(diagnostics, "send", lambda publisher, array: sent.extend(array.status))
    return sent


@pytest.fixture
def line(reported):
    """Diagnostics of a driver whose acquisition fell behind in the last second."""
    node = SimpleNamespace(
        get_fully_qualified_name=lambda: "/driver_node",
        create_timer=lambda *arguments, **named: None,
        get_clock=Clock,
        faults=0,
        recent_fault="",
    )
    line = diagnostics.DriverDiagnostics(node, StopLatch())
    tally, keeper = Tally(), NoKeeper()
    keeper.begin_step()
    playback = Playback(0.0, 0.0, 1e-3, 1.0)
    line.watch(SimpleNamespace(tally=tally, keeper=keeper, playback=playback, block_size=10), 1000.0)
    line.state(DiagnosticStatus.OK, "streaming")
    tally.postponed = 0.7
    return line


def test_a_delay_does_not_hide_an_error(line, reported):
    line.state(DiagnosticStatus.ERROR, "the device is unplugged")
    assert reported[-1].level == DiagnosticStatus.ERROR
    assert reported[-1].message == "the device is unplugged; behind by 0.7 s; the stamps moved"


def test_a_delay_does_not_hide_a_stop(line, reported):
    line._latch.set()
    line.publish()
    assert reported[-1].level == DiagnosticStatus.WARN
    assert "nothing moves until ~/release" in reported[-1].message and "behind by 0.7 s" in reported[-1].message


def test_everything_is_well_again_after_a_delay(line, reported):
    line.publish()
    line.publish()
    assert [(s.level, s.message) for s in reported[-2:]] == [
        (DiagnosticStatus.WARN, "streaming; behind by 0.7 s; the stamps moved"),
        (DiagnosticStatus.OK, "streaming"),
    ]
