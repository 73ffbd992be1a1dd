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

"""A session that is interrupted or fails leaves no stage energised; one that is refused moves no stage."""

import re
import threading
import time

import numpy as np
import pytest

from benchmarks.wire import (
    LSB,
    PERIOD,
    RAMP,
    SAFE_WITHIN,
    TOP,
    WiredSession,
    check_wire,
    device,
    leave_at,
    settings,
    values,
)
from piezo_hysteresis.acquisition.safety.keeper import READY
from piezo_hysteresis.acquisition.safety.keeper_link import KeeperLink
from piezo_hysteresis.acquisition.session import DriverSession
from piezo_hysteresis.acquisition.streaming import StreamingAcquisition
from piezo_hysteresis.errors import StageError
from piezo_hysteresis.record import Record
from piezo_hysteresis.stage.daqmx.daqmx_error import DaqmxError
from piezo_hysteresis.stage.gcs2.connection import Gcs2Error

pytestmark = pytest.mark.device

pytest.importorskip("nidaqmx", reason="nidaqmx is not installed: pip install 'nidaqmx[grpc]'")

SLOW = 5.0
"""Rate of a way to the safe voltage that takes longer than a keeper waits [V/s]."""


def held(s, voltage=4.0):
    s.start()
    s.wait(lambda: s.deliveries, "the stream")
    s.acquisition.ramp_to(voltage)
    s.wait(lambda: s.acquisition.playback.voltage == voltage and abs(s.output - voltage) <= SAFE_WITHIN, "the voltage")


@pytest.mark.parametrize("word", ["gcs2", "nidaqmx"])
def test_a_stage_that_its_driver_cannot_make_safe_is_left_to_the_keeper(word, monkeypatch):
    with device(word) as (name, parameters, amplifier, _):
        s = WiredSession(name, parameters, amplifier, keeper_timeout=20.0)
        held(s)

        def fails(goal):
            raise (Gcs2Error if word == "gcs2" else DaqmxError)("the fault that was asked for")

        monkeypatch.setattr(s.session.stage, "_go", fails)
        monkeypatch.setattr(s.session.stage._limiter, "ramp", lambda *_: fails(0.0))
        with pytest.raises(StageError, match=r"fault that was asked for; .*its keeper then brought it to its safe"):
            s.session.close()
        assert abs(s.output) <= SAFE_WITHIN
        check_wire(s.wire)


@pytest.mark.parametrize("word", ["simulated", "gcs2"])
def test_an_interrupt_on_the_way_to_safety_is_followed_by_a_complete_close(word, monkeypatch):
    with device(word) as (name, parameters, amplifier, _):
        s = WiredSession(name, parameters, amplifier)
        held(s)
        end = s.acquisition.make_safe

        def interrupted(timeout):
            monkeypatch.setattr(s.acquisition, "make_safe", end)
            raise KeyboardInterrupt

        monkeypatch.setattr(s.acquisition, "make_safe", interrupted)
        with pytest.raises(KeyboardInterrupt):
            s.session.make_safe()
        s.session.close()
        assert not s.acquisition._thread.is_alive()
        assert abs(s.output) <= SAFE_WITHIN
        check_wire(s.wire)
        assert not s.failures


def test_an_interrupt_in_the_moment_of_the_start_is_followed_by_a_complete_close(monkeypatch):
    """The session did not know its thread yet, and closed the stage under it."""
    with device("gcs2") as (name, parameters, amplifier, _):
        s = WiredSession(name, parameters, amplifier)
        start, begun = StreamingAcquisition.start, []

        def interrupted(acquisition):
            start(acquisition)
            begun.append(acquisition)
            raise KeyboardInterrupt

        monkeypatch.setattr(StreamingAcquisition, "start", interrupted)
        with pytest.raises(KeyboardInterrupt):
            s.start()
        s.session.close()
        assert not begun[0]._thread.is_alive()
        assert not s.failures


def test_an_interrupt_while_the_keeper_starts_leaves_the_stage_to_the_driver_alone(monkeypatch):
    """The keeper heard nothing and moved the stage, too: two ramps at once, and a step between them."""
    with device("gcs2") as (name, parameters, amplifier, (controller, _)):
        leave_at("gcs2", controller, TOP)
        begin, started, keepers = amplifier.wire.size, KeeperLink._started, []

        def interrupted(keeper, order):
            keepers.append(keeper)
            assert started(keeper, order) == READY
            raise KeyboardInterrupt

        monkeypatch.setattr(KeeperLink, "_started", interrupted)
        with pytest.raises(KeyboardInterrupt):
            WiredSession(name, parameters, amplifier, keeper_timeout=0.3, ramp_rate=SLOW)
        assert keepers[0]._process.poll() is not None
        assert abs(amplifier.output) <= SAFE_WITHIN
        assert np.abs(np.diff(amplifier.wire[begin:])).max() <= SLOW * PERIOD + 2 * LSB


def test_a_driver_that_is_closed_while_its_keeper_acts_waits_for_it(monkeypatch):
    """It was silent between configure and activate, for example suspended."""
    with device("gcs2") as (name, parameters, amplifier, (controller, _)):
        leave_at("gcs2", controller, TOP)
        begin = amplifier.wire.size
        s = WiredSession(name, parameters, amplifier, keeper_timeout=1.0, ramp_rate=SLOW)
        stage, keeper, ends = s.session.stage, s.session._keeper, []
        close = stage.close
        monkeypatch.setattr(stage, "close", lambda: ends.append(keeper._process.poll()) or close())
        keeper.begun = -np.inf  # no further heartbeats
        s.wait(lambda: s.output < 0.9 * TOP, "the keeper")
        s.session.close()
        assert ends == [0], "the keeper had ended before the driver used the stage"
        assert abs(s.output) <= SAFE_WITHIN
        assert np.abs(np.diff(amplifier.wire[begin:])).max() <= SLOW * PERIOD + 2 * LSB


@pytest.mark.parametrize("word", ["gcs2", "nidaqmx"])
@pytest.mark.parametrize("changes", [{}, {"sample_period": 3.0}])
def test_a_refused_second_driver_touches_nothing(word, changes):
    with device(word) as (name, parameters, amplifier, _):
        s = WiredSession(name, parameters, amplifier)
        held(s)
        before = s.wire.size
        with pytest.raises(StageError, match=r"is held by process|got sample period"):
            WiredSession(name, parameters, amplifier, **changes)
        time.sleep(0.3)
        assert np.ptp(s.wire[before - 1 :]) <= LSB
        assert not s.failures
        s.acquisition.ramp_to(1.0)
        s.wait(lambda: abs(s.output - 1.0) <= SAFE_WITHIN, "the next set-point")
        s.end()


def test_a_device_with_a_buffer_is_reported_safe_when_its_output_is_and_starts_again():
    with device("nidaqmx") as (name, parameters, amplifier, _):
        s = WiredSession(name, parameters, amplifier)
        for _ in range(2):
            s.deliveries.clear()
            held(s)
            s.session.make_safe()
            assert abs(s.output) <= SAFE_WITHIN
            assert abs(s.deliveries[-1].block.voltage[-1]) <= 0.01, "it was measured"
            time.sleep(1.0)  # longer than the buffer
        assert not s.failures
        s.end()
        check_wire(s.wire)


def test_a_stage_that_another_program_moves_before_the_stream_is_not_stepped_back():
    """The first sample was the voltage at which the stage had been opened."""
    with device("nidaqmx") as (name, parameters, amplifier, (card, _)):
        s = WiredSession(name, parameters, amplifier)
        card.set(4.0)
        begin = amplifier.wire.size
        s.start()
        s.wait(lambda: s.failures, "the refusal")
        assert re.search(r"output is at \S+ V, expected 0 V.*safe voltage, 0 V", str(s.failures[0]))
        s.end()
        steps = np.diff(amplifier.wire[begin:])
        assert np.abs(steps).max() <= RAMP * PERIOD + 2 * LSB
        assert abs(amplifier.output) <= SAFE_WITHIN


def test_a_card_left_outside_the_limits_is_ramped_from_where_it_is():
    """It was taken for one at the limit, and went there in one step."""
    with device("nidaqmx") as (name, parameters, amplifier, (card, _)):
        card.set(9.0)
        begin = amplifier.wire.size
        s = WiredSession(name, parameters | {"voltage_max": 5.0}, amplifier, voltage_max=5.0)
        (notice,) = s.session.notices
        assert re.search(r"found at (9|8\.99\d+) V, outside 0 to 5 V", notice)
        s.start()
        s.wait(lambda: s.deliveries, "the stream")
        s.end()
        assert np.abs(np.diff(amplifier.wire[begin:])).max() <= RAMP * PERIOD + 2 * LSB
        assert abs(amplifier.output) <= SAFE_WITHIN


@pytest.mark.parametrize("kept", [True, False])
def test_a_call_that_does_not_return_is_left_to_the_keeper(kept, monkeypatch):
    """The stage is not used from two threads; without a keeper the late thread makes it safe."""
    with device("gcs2") as (name, parameters, amplifier, _):
        s = WiredSession(name, parameters, amplifier, keeper_timeout=20.0 if kept else 0.0)
        held(s)
        released, hangs, callers = threading.Event(), threading.Event(), []
        read, safe = s.session.stage.read_voltage, s.session.stage.safe

        def hanging():
            hangs.set()
            released.wait(60.0)
            return read()

        monkeypatch.setattr(s.session.stage, "read_voltage", hanging)
        monkeypatch.setattr(s.session.stage, "safe", lambda: (callers.append(threading.current_thread().name), safe()))
        monkeypatch.setattr(s.session, "_longest_step", lambda: 1.0)
        s.wait(hangs.is_set, "the call")
        expected = "its keeper was asked" if kept else "no keeper"
        with pytest.raises(StageError, match=f"does not return; its voltage is unknown, .*{expected}"):
            s.session.close()
        assert callers == []
        with pytest.raises(StageError, match="still uses the stage"):
            s.start()
        with pytest.raises(StageError, match="is held by process"):
            WiredSession(name, parameters, amplifier)
        if kept:
            s.wait(lambda: abs(s.output) <= SAFE_WITHIN, "the keeper")
        released.set()
        s.acquisition._thread.join(30.0)
        assert callers == ([] if kept else ["acquisition"])
        s.wait(lambda: abs(s.output) <= SAFE_WITHIN, "the safe voltage")
        s.session.close()
        check_wire(s.wire)


def test_a_thread_that_hangs_ends_the_heartbeats(monkeypatch):
    with device("gcs2") as (name, parameters, amplifier, _):
        monkeypatch.setattr(DriverSession, "_longest_step", lambda session: 2.0)
        s = WiredSession(name, parameters, amplifier, keeper_timeout=1.0)
        held(s)
        time.sleep(4.0)
        assert s.output == pytest.approx(4.0, abs=SAFE_WITHIN), "a thread that works keeps its stage"
        released = threading.Event()
        monkeypatch.setattr(s.session.stage, "read_voltage", lambda: released.wait(60.0))
        s.wait(lambda: abs(s.output) <= SAFE_WITHIN, "the keeper")
        released.set()
        s.wait(lambda: s.failures, "the end of the driver")
        s.end()
        check_wire(s.wire)


def test_a_replay_that_waits_for_subscribers_ends_at_once():
    record = Record(np.linspace(0.0, 5.0, 5000), np.zeros(5000), 1e-3, "noise")
    given = values("replay", experiment="recording", subscribers=1)
    session = DriverSession(settings("replay", sample_period=0.0), given, "test replay", lambda path: (record,))
    failures = []
    acquisition = session.start(
        node_clock=time.time_ns, deliver=lambda delivery: None, fail=failures.append, subscribers=lambda: 0
    )
    session.close()
    assert not acquisition.is_running
    assert not failures


def test_a_simulated_stage_in_slow_motion_is_brought_to_its_safe_voltage():
    with device("simulated") as (name, parameters, amplifier, _):
        s = WiredSession(name, parameters, amplifier, real_time_factor=0.1, block_duration=1.0)
        s.start()
        s.acquisition.ramp_to(1.0)
        s.session.close()
        assert s.output == 0.0
