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

"""The acquisition against a stage that checks every sample itself, and can fail."""

import threading
import time
from asyncio import CancelledError
from dataclasses import replace

import numpy as np
import pytest

from piezo_hysteresis.acquisition.drive import EventKind
from piezo_hysteresis.acquisition.memory import MemoryAcquisition
from piezo_hysteresis.acquisition.playback import Playback
from piezo_hysteresis.acquisition.streaming import StreamingAcquisition
from piezo_hysteresis.acquisition.time_base import LATEST_STAMP, TimeBase
from piezo_hysteresis.errors import StageError
from piezo_hysteresis.stage.simulated import SimulatedMemoryStage

from .witness import Witness

PERIOD = 1e-4
RAMP_RATE = 200.0


class Listener:
    """Keeps deliveries and failures."""

    def __init__(self):
        self.deliveries, self.failures, self._new = [], [], threading.Condition()

    def deliver(self, delivery):
        with self._new:
            self.deliveries.append(delivery)
            self._new.notify_all()

    def fail(self, error):
        with self._new:
            self.failures.append(error)
            self._new.notify_all()

    def wait(self, condition):
        with self._new:
            assert self._new.wait_for(lambda: condition(self), 30.0)

    def joined(self, name):
        return np.concatenate([getattr(d.block, name) for d in self.deliveries])

    def events(self, kind):
        return [e.phase.name for d in self.deliveries for e in d.events if e.kind is kind]


def made(stage, kind=StreamingAcquisition, rate=10.0, clock=time.time_ns, **named):
    listener = Listener()
    playback = Playback(stage.voltage, 0.0, PERIOD, RAMP_RATE)
    named |= {"node_clock": clock, "deliver": listener.deliver, "fail": listener.fail}
    acquisition = kind(stage, playback, TimeBase(PERIOD, rate), 100, **named)
    return acquisition, listener


def started(stage, kind=StreamingAcquisition, rest_period=0.02, **named):
    acquisition, listener = made(stage, kind, **named)
    acquisition.rest_period = rest_period  # of a stage with memory
    acquisition.start()
    listener.wait(lambda heard: heard.deliveries or heard.failures)
    return acquisition, listener


def play(acquisition, waveform, name):
    acquisition.play(np.asarray(waveform), name, 1, lambda wave, voltage: None, lambda phase, size: None)


def test_make_safe_ramps_down_and_gives_every_sample_of_it():
    acquisition, listener = started(Witness(PERIOD, RAMP_RATE))
    play(acquisition, np.linspace(0, 5, 300), "up")
    listener.wait(lambda heard: "up" in heard.events(EventKind.DONE))
    assert acquisition.make_safe(30.0)
    voltage = listener.joined("voltage")
    assert voltage.max() == 5.0
    assert voltage[-1] == 0.0
    assert np.abs(np.diff(voltage)).max() <= RAMP_RATE * PERIOD * (1 + 1e-9)
    assert np.array_equal(listener.joined("index"), np.arange(voltage.size))
    assert not listener.failures


@pytest.mark.parametrize("lead", [0.0, 1.0])
def test_neither_the_stream_nor_a_stop_waits_for_the_report_of_a_command(lead):
    """And still, what is reported first is that the command was accepted."""
    stage = OwnClock(1.0, lead) if lead else Witness(PERIOD, RAMP_RATE)
    acquisition, listener = started(stage, rate=1.0)
    reports, writable = [], threading.Event()

    def accepted(phase, size):
        assert writable.wait(30.0)
        reports.append("accepted")

    def deliver(delivery):
        reports.extend(e.kind.value for e in delivery.events if e.phase.name == "slow")
        listener.deliver(delivery)

    acquisition._deliver = deliver
    asked = ("slow", 1, lambda wave, voltage: None, accepted)
    reporting = threading.Thread(target=acquisition.play, args=(np.linspace(0, 5, 50_000), *asked))
    reporting.start()
    try:
        while not acquisition.playback.is_playing:
            time.sleep(1e-3)
        before = len(listener.deliveries)
        if lead:  # so many samples are on their way before the first one of the command
            listener.wait(lambda heard: heard.failures or len(heard.deliveries) > before + 20)
        stopping = threading.Thread(target=acquisition.stop)
        stopping.start()
        stopping.join(10.0)
        assert acquisition.playback.is_stopping or acquisition.playback.is_safe
    finally:
        writable.set()
        reporting.join(30.0)
    assert acquisition.make_safe(30.0)
    assert not listener.failures
    assert reports == ["accepted", "began", "stopped"]


def test_a_failing_stage_is_made_safe_and_reported_once():
    stage = Witness(PERIOD, RAMP_RATE, fails_at=3)
    acquisition, listener = started(stage)
    listener.wait(lambda heard: heard.failures)
    assert [str(e) for e in listener.failures] == ["witness: link lost"]
    assert stage.made_safe == 1
    assert acquisition.make_safe(30.0)
    assert len(listener.deliveries) == 2


def test_a_stage_that_cannot_be_made_safe_is_reported():
    _, listener = started(Witness(PERIOD, RAMP_RATE, fails_at=2, unsafe=True))
    listener.wait(lambda heard: heard.failures)
    assert "could not be brought to its safe voltage: witness: no link" in str(listener.failures[0])


def test_the_stage_is_the_last_line_of_defence():
    """A waveform that got past every check is not played, and the driver reports it."""
    stage = Witness(PERIOD, RAMP_RATE)
    acquisition, listener = started(stage)
    play(acquisition, [0.0, 11.0], "too_high")
    listener.wait(lambda heard: heard.failures)
    assert "11.0 V" in str(listener.failures[0])
    assert stage.made_safe == 1
    assert not listener.joined("voltage").any()


def test_a_fault_of_the_program_leaves_the_stage_safe_too():
    stage = Witness(PERIOD, RAMP_RATE)
    stage.exchange = lambda voltage: 1 / 0
    _, listener = started(stage)
    listener.wait(lambda heard: heard.failures)
    assert "ZeroDivisionError" in str(listener.failures[0])
    assert stage.made_safe == 1


@pytest.mark.parametrize("end", [SystemExit, CancelledError])
def test_a_library_that_ends_the_thread_does_not_leave_the_stage_energised(end):
    """These are no `Exception`: the thread ended without a word, at the voltage that it had reached."""
    stage = Witness(PERIOD, RAMP_RATE)
    exchange = stage.exchange

    def fails_on_its_way(voltage):
        if stage.voltage > 1.0:
            raise end("library of the device")
        return exchange(voltage)

    stage.exchange = fails_on_its_way
    acquisition, listener = started(stage)
    acquisition.ramp_to(5.0)
    listener.wait(lambda heard: heard.failures)
    assert "library of the device" in str(listener.failures[0])
    assert (stage.made_safe, stage.voltage) == (1, 0.0)


def test_a_thread_that_begins_after_its_stage_was_given_up_leaves_it_alone():
    """An interrupt while a thread is started: the stage was closed under it."""
    stage = Witness(PERIOD, RAMP_RATE)
    acquisition, listener = made(stage)
    assert acquisition.make_safe(1.0)
    acquisition.start()
    acquisition.make_safe(30.0)
    assert (stage.made_safe, listener.deliveries, listener.failures) == (0, [], [])


def test_a_stall_is_caught_up_with_by_count():
    stage = Witness(PERIOD, RAMP_RATE)
    acquisition, listener = started(stage, rate=1.0)
    exchange, stalled = stage.exchange, threading.Event()

    def slow(voltage):
        if not stalled.is_set():
            stalled.set()
            time.sleep(0.2)
        return exchange(voltage)

    stage.exchange = slow
    stalled.wait(30.0)
    before = len(listener.deliveries)
    listener.wait(lambda heard: len(heard.deliveries) > before + 30)
    assert acquisition.make_safe(30.0)
    stamps = np.array([d.block.stamp for d in listener.deliveries])
    assert np.abs(np.diff(stamps) - round(100 * PERIOD * 1e9)).max() <= 1
    assert np.array_equal(listener.joined("index"), np.arange(100 * len(listener.deliveries)))


class OwnClock(Witness):
    """A witness with a clock of its own and an output buffer that must not run empty."""

    def __init__(self, speed, lead):
        super().__init__(PERIOD, RAMP_RATE)
        self.description = replace(self.description, latency=lead)
        self._period, self._lead, self._begin, self._given = PERIOD / speed, round(lead / PERIOD), None, 0

    def exchange(self, voltage):
        self._begin = self._begin or time.monotonic()
        if time.monotonic() > self._begin + (self._given + self._lead) * self._period:
            raise StageError("witness: the output buffer ran empty")
        self._given += voltage.size
        time.sleep(max(self._begin + self._given * self._period - time.monotonic(), 0.0))
        return super().exchange(voltage)


def test_a_device_with_its_own_clock_sets_the_rate_and_the_stamps():
    """At the pace of this computer the buffer of one so fast would run empty within 0.8 s."""
    acquisition, listener = started(OwnClock(1.5, lead=0.4), rate=1.0)
    listener.wait(lambda heard: heard.failures or len(heard.deliveries) > 160)
    assert not listener.failures
    stamps = np.array([d.block.stamp for d in listener.deliveries]) * 1e-9
    assert stamps[-1] - stamps[0] == pytest.approx(160 * 100 * PERIOD / 1.5, rel=0.1)
    assert np.array_equal(listener.joined("index"), np.arange(100 * len(listener.deliveries)))
    assert acquisition.tally.clock_drift < 0.0
    assert acquisition.make_safe(30.0)


@pytest.mark.parametrize("buffered", [False, True])
def test_a_waveform_that_a_fault_ends_is_reported_as_stopped_with_the_reason(buffered):
    """Also one that was put out completely, if its last samples were still in the buffer of the device."""
    stage = OwnClock(1.0, lead=0.4) if buffered else Witness(PERIOD, RAMP_RATE)
    acquisition, listener = started(stage, rate=1.0)
    play(acquisition, np.zeros(100), "first")
    listener.wait(lambda heard: "first" in heard.events(EventKind.DONE))
    play(acquisition, np.zeros(100 if buffered else 100_000), "second")
    if buffered:
        listener.wait(lambda heard: not acquisition.playback.is_playing)
    stage._fails_at = stage._calls + 2
    listener.wait(lambda heard: heard.failures)
    assert acquisition.make_safe(30.0)
    assert listener.events(EventKind.DONE) == ["first"]
    assert listener.events(EventKind.STOPPED) == ["second"]
    assert listener.deliveries[-1].events[-1].reason == "witness: link lost"
    assert np.array_equal(listener.joined("index"), np.arange(acquisition.index)), "no sample is made up"


def test_the_stream_goes_on_after_the_last_date_of_a_message():
    acquisition, listener = started(Witness(PERIOD, RAMP_RATE), clock=lambda: 2**31 * 10**9 + time.time_ns())
    listener.wait(lambda heard: heard.failures or len(heard.deliveries) > 3)
    assert acquisition.make_safe(30.0)
    assert not listener.failures
    assert {d.block.stamp for d in listener.deliveries} == {LATEST_STAMP}
    assert acquisition.tally.undated == len(listener.deliveries)


def test_after_a_long_stall_stamps_move_and_samples_do_not():
    acquisition, listener = started(Witness(PERIOD, RAMP_RATE), rate=1.0)
    acquisition.patience = -1.0
    before = len(listener.deliveries)
    listener.wait(lambda heard: len(heard.deliveries) > before + 3)
    assert acquisition.make_safe(30.0)
    assert acquisition.tally.postponed > 0.0
    assert np.array_equal(listener.joined("index"), np.arange(100 * len(listener.deliveries)))


@pytest.mark.parametrize("playing", [True, False])
def test_stop_interrupts_a_waveform_played_from_memory(playing):
    stage = SimulatedMemoryStage(sample_period=PERIOD, longest_block=100_000)
    acquisition, listener = started(stage, MemoryAcquisition, rate=1.0, rest_period=0.01)
    if playing:
        play(acquisition, np.concatenate((np.linspace(0, 5, 300), np.full(50_000, 5.0))), "long")
        time.sleep(0.1)
    else:
        acquisition.ramp_to(1.0)
        listener.wait(lambda heard: heard.joined("voltage")[-1] == pytest.approx(1.0, abs=1e-3))
    acquisition.stop()
    assert acquisition.make_safe(30.0)
    assert stage.voltage == 0.0
    assert listener.events(EventKind.STOPPED) == (["long"] if playing else [])
    voltage = listener.joined("voltage")
    assert voltage[-1] == 0.0
    index = listener.joined("index").astype(np.int64)
    assert (np.diff(index) > 0).all()
    assert acquisition.tally.never_measured + voltage.size == index[-1] + 1
    assert not listener.failures
