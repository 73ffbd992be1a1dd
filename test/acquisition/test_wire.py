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

"""The limiter stands last on every path: each device puts out nothing outside range, slew and ramp rate."""

import re
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.wire import (
    LSB,
    PERIOD,
    RAMP,
    SAFE_WITHIN,
    SLEW,
    TOP,
    WiredSession,
    check_wire,
    device,
    leave_at,
    settings,
    values,
)
from piezo_hysteresis.acquisition.drive import EventKind
from piezo_hysteresis.emulators.fault import Faults
from piezo_hysteresis.errors import ParameterError, StageError

pytestmark = pytest.mark.device

pytest.importorskip("nidaqmx", reason="nidaqmx is not installed: pip install 'nidaqmx[grpc]'")

WORDS = ("simulated", "memory", "gcs2", "nidaqmx")


@pytest.fixture
def wired():
    """Make sessions on an emulated device; ended with the test."""
    stack, made = [], []

    def make(word, **options):
        opened = device(word, **options)
        word, parameters, amplifier, emulated = opened.__enter__()
        stack.append(opened)
        session = WiredSession(word, parameters, amplifier)
        made.append(session)
        return session, emulated

    yield make
    for session in made:
        session.end()
    for opened in reversed(stack):
        opened.__exit__(None, None, None)


def falls_to_safety(s, since):
    """Wait until the wire is at the safe voltage; it fell at the ramp rate from where it was."""
    s.wait(lambda: s.wire.size > since + 100 and abs(s.output) <= SAFE_WITHIN, "the safe voltage")
    way = s.wire[since:]
    top = way.max()
    falling = np.flatnonzero(way > 0.1 * top)[-1] - np.flatnonzero(way >= 0.9 * top - LSB)[-1]
    assert falling == pytest.approx(0.8 * top / (RAMP * PERIOD), rel=0.05), "straight, at the ramp rate"


@pytest.mark.parametrize("word", WORDS)
def test_a_stop_in_mid_waveform(wired, word):
    s, _ = wired(word)
    s.start()
    s.rises()
    since = s.wire.size
    s.acquisition.stop()
    falls_to_safety(s, since)
    check_wire(s.wire)
    assert not s.failures
    time.sleep(0.05)
    s.wait(lambda: s.acquisition.playback.is_safe, "rest")
    s.wait(lambda: any(e.kind is EventKind.STOPPED for d in list(s.deliveries) for e in d.events), "the report of it")


@pytest.mark.parametrize("word", WORDS)
def test_a_set_point_that_arrives_during_a_ramp_is_reached_without_a_step(wired, word):
    s, _ = wired(word)
    s.start()
    s.wait(lambda: s.deliveries, "the stream")
    for goals in ((5.0, 0.0), (5.0, 1.0, 3.0)):
        for goal in goals:
            s.acquisition.ramp_to(goal)
            time.sleep(0.03)
        s.wait(lambda goal=goal: s.acquisition.playback.voltage == goal, f"{goal:g} V")
        s.wait(lambda goal=goal: abs(s.output - goal) <= SAFE_WITHIN, f"{goal:g} V at the wire")
    assert np.abs(np.diff(s.wire)).max() <= RAMP * PERIOD + 2 * LSB
    assert not s.failures


def test_a_stop_during_an_upload_starts_nothing(wired):
    s, (controller, _) = wired("gcs2")
    heard, carry_out = [], controller.carry_out

    def listening(line):
        heard.append(line)
        return carry_out(line)

    controller.carry_out = listening
    s.start()
    s.play(np.concatenate((np.linspace(0.0, TOP, 6000), np.full(20_000, TOP))))
    s.wait(lambda: sum(line.startswith("WAV 1") for line in heard) > 20, "the upload")
    s.acquisition.stop()
    chunks = sum(line.startswith("WAV 1") for line in heard)
    s.wait(lambda: "\x18" in heard, "the stop at the controller")
    s.wait(lambda: not s.acquisition.playback.is_stopping, "rest")
    assert sum(line.startswith("WAV 1") for line in heard) <= chunks + 2, "the chunk under way is the last one"
    assert "WGO 1 1" not in heard
    assert np.ptp(s.wire) <= LSB
    with pytest.raises(StageError, match="call ~/release first"):
        s.play(np.zeros(10))
    with pytest.raises(StageError, match="call ~/release first"):
        s.acquisition.ramp_to(1.0)
    s.session.latch.release()
    s.acquisition.ramp_to(0.5)
    s.wait(lambda: s.output == pytest.approx(0.5, abs=1e-6), "the set-point")


def test_a_stop_during_a_read_out(wired):
    s, (controller, _) = wired("gcs2")
    s.start()
    waves = s.session.stage._axis.waves
    waves.setup = replace(waves.setup, rows_per_answer=10)
    answers, carry_out = [], controller.carry_out

    def listening(line):
        if line.startswith("DRR?"):
            answers.append(line)
            if len(answers) == 3:
                s.acquisition.stop()
        return carry_out(line)

    controller.carry_out = listening
    s.play(np.linspace(0.0, 3.0, 3000))
    s.wait(lambda: len(answers) >= 3, "the read-out")
    s.wait(lambda: s.acquisition.playback.is_safe and abs(s.output) <= SAFE_WITHIN, "the safe voltage")
    assert len(answers) == 3, "the answer under way is the last one"
    check_wire(s.wire)
    assert not s.failures


@pytest.mark.parametrize("word", ["simulated", "nidaqmx"])
def test_a_streaming_device_falls_within_its_buffer_and_two_blocks(wired, word):
    s, _ = wired(word)
    s.start()
    s.play(np.concatenate((np.linspace(0.0, 3.0, 3000), np.full(100_000, 3.0))))
    s.wait(lambda: s.output == pytest.approx(3.0, abs=LSB), "the top")
    asked = s.wire.size
    s.acquisition.stop()
    s.wait(lambda: s.output < 2.9, "the fall")
    latency = round(s.session.limits.latency / PERIOD)
    block = s.session.settings.block_size(PERIOD)
    fallen = np.flatnonzero(s.wire[asked:] < 3.0 - 2 * LSB)
    assert fallen[0] <= latency + 3 * block


@pytest.mark.parametrize("word", WORDS)
def test_the_end_of_a_driver_in_mid_waveform(wired, word):
    s, _ = wired(word)
    s.start()
    s.rises()
    since = s.wire.size
    s.session.make_safe()
    s.session.close()
    falls_to_safety(s, since)
    check_wire(s.wire)


@pytest.mark.parametrize("word", WORDS)
def test_closing_the_stage_alone(wired, word):
    """No session that plays a ramp: the stage itself goes down from a set-point when it is closed."""
    s, _ = wired(word)
    s.session.stage.set_voltage(TOP)
    since = s.wire.size
    s.session.close()
    falls_to_safety(s, since)
    check_wire(s.wire)


@pytest.mark.parametrize(
    ("word", "fault"),
    [
        ("simulated", ""),
        ("memory", ""),
        ("gcs2", "link_lost@VOL?"),
        ("gcs2", "link_lost@ERR?"),
        ("gcs2", "garbled@ERR?"),
        ("nidaqmx", "device_lost@ReadAnalogF64"),
        ("nidaqmx", "link_lost@WriteAnalogF64"),
        ("nidaqmx", "underflow@ReadAnalogF64"),
    ],
)
def test_a_fault_in_mid_waveform(wired, word, fault):
    from piezo_hysteresis.emulators.daqmx.faults import FAULTS as NI
    from piezo_hysteresis.emulators.gcs2.faults import FAULTS as GCS2

    s, emulated = wired(word)
    s.start()
    s.rises()
    since = s.wire.size
    if emulated is None:

        def fails(*_):
            raise StageError("the fault that was asked for")

        s.session.stage.exchange = s.session.stage.wait = fails
    else:
        emulated[0].faults = Faults([(GCS2 if word == "gcs2" else NI).parse(fault)])
        if word == "gcs2":
            s.acquisition.cancel()  # the fault strikes on the way to safety
    s.wait(lambda: s.failures, "the failure")
    falls_to_safety(s, since)
    check_wire(s.wire)


@pytest.mark.parametrize("word", ["gcs2", "nidaqmx"])
def test_the_next_start_at_a_voltage_that_a_killed_driver_has_left(word):
    with device(word) as (name, parameters, amplifier, (emulated, _)):
        leave_at(word, emulated, TOP)
        since = len(amplifier.parts)
        s = WiredSession(name, parameters, amplifier)
        opened = np.concatenate([np.full(1, TOP), *amplifier.parts[since:]])
        assert np.ptp(opened) <= LSB, "opening moves nothing"
        s.start()
        s.wait(lambda: abs(s.output) <= SAFE_WITHIN, "the safe voltage")
        wire = np.concatenate([np.full(1, TOP), *amplifier.parts[since:]])
        check_wire(wire, begins=TOP)
        assert np.flatnonzero(wire > 0.05)[-1] - np.flatnonzero(wire > 0.95 * TOP)[-1] > 0.85 * TOP / (RAMP * PERIOD)
        s.end()


@pytest.mark.parametrize("word", ["gcs2", "nidaqmx"])
def test_a_stage_that_was_left_outside_the_limits_of_the_driver_is_first_made_safe(word):
    left = TOP + 2.0
    with device(word) as (name, parameters, amplifier, (emulated, _)):
        leave_at(word, emulated, left)
        since = len(amplifier.parts)
        s = WiredSession(name, parameters, amplifier, voltage_max=TOP)
        assert np.ptp(np.concatenate([np.full(1, left), *amplifier.parts[since:]])) <= LSB, "opening moves nothing"
        if word == "nidaqmx":
            (notice,) = s.session.notices
            assert re.search(r"found at (8|7\.99\d*) V, outside 0 to 6 V; the start ramps it to 0 V", notice)
        s.start()
        s.wait(lambda: abs(s.output) <= SAFE_WITHIN, "the safe voltage")
        check_wire(np.concatenate([np.full(1, left), *amplifier.parts[since:]]), begins=left)
        assert s.session.notices == ()
        s.wait(lambda: not s.acquisition.playback.is_stopping, "the end of the way to the safe voltage")
        s.acquisition.ramp_to(1.0)
        s.wait(lambda: abs(s.output - 1.0) <= SAFE_WITHIN, "the first set-point")
        assert not s.failures
        s.end()


@pytest.mark.parametrize(
    ("word", "wrong"),
    [
        ("gcs2", {"sample_period": 1.3 * PERIOD}),
        ("gcs2", {"voltage_max": 50.0}),
        ("nidaqmx", {"voltage_max": 50.0}),
        ("nidaqmx", {"ramp_rate": 2 * SLEW}),
    ],
)
def test_a_driver_whose_settings_are_refused_makes_the_stage_safe_within_its_rates(word, wrong):
    """It knew no limits but those of the device, and went to the safe voltage in one step."""
    with device(word) as (name, parameters, amplifier, (emulated, _)):
        leave_at(word, emulated, TOP)
        since = len(amplifier.parts)
        with pytest.raises((ParameterError, StageError), match="got"):
            WiredSession(name, parameters, amplifier, **wrong)
        fall = SLEW if "ramp_rate" in wrong else RAMP
        steps = np.diff(np.concatenate([np.full(1, TOP), *amplifier.parts[since:]]))
        assert steps.max() <= 2 * LSB
        assert steps.min() >= -fall * PERIOD - 2 * LSB
        assert abs(amplifier.output) <= SAFE_WITHIN


def test_a_controller_that_another_program_stops_on_the_way_to_safety_makes_no_step():
    """Its ramp counted as played, and the rest of the way was one step."""
    with device("gcs2") as (name, parameters, amplifier, (controller, _)):
        s = WiredSession(name, parameters, amplifier, ramp_rate=5.0)
        leave_at("gcs2", controller, TOP)
        begin = s.wire.size
        with ThreadPoolExecutor(1) as other, suppress(StageError):
            safe = other.submit(s.session.stage.safe)
            s.wait(lambda: s.output < 0.7 * TOP, "the way to the safe voltage")
            controller.carry_out("\x18")
            controller.carry_out("ERR?")  # the other program reads its error
            safe.result(30.0)
        s.session.stage.safe()
        assert abs(s.output) <= SAFE_WITHIN
        assert np.abs(np.diff(s.wire[begin:])).max() <= 5.0 * PERIOD + 2 * LSB
        s.end()


def test_a_steep_way_to_safety_whose_last_step_is_small_ends_at_the_safe_voltage():
    """The controller draws the line up to a full step before its end; this was taken for a stop by another program."""
    steep = 5000.0
    with device("gcs2") as (name, parameters, amplifier, (controller, _)):
        s = WiredSession(name, parameters, amplifier, ramp_rate=steep, max_slew_rate=steep)
        leave_at("gcs2", controller, 10.02 * steep * PERIOD)
        s.session.stage.safe()
        assert abs(s.output) <= SAFE_WITHIN
        s.end()


def test_a_card_that_shows_nothing_about_its_output_is_refused_unless_allowed():
    with device("nidaqmx", reads_back=False) as (name, parameters, amplifier, _):
        blind = parameters | {"voltage_input": ""}
        with pytest.raises(StageError, match=r"the voltage at the output is unknown.*assume_safe"):
            WiredSession(name, blind, amplifier)
        WiredSession(name, blind | {"assume_safe": True}, amplifier).end()


@pytest.mark.parametrize("word", ["gcs2", "nidaqmx"])
def test_a_device_without_a_slew_limit_is_refused(word):
    with device(word) as (name, parameters, amplifier, _):
        with pytest.raises(StageError, match=r"max_slew_rate: got 0 V/s, expected the steepest .* finite"):
            WiredSession(name, parameters | {"max_slew_rate": 0.0}, amplifier)
        assert amplifier.parts == [] or np.ptp(amplifier.wire) == 0.0, "nothing has moved"


def test_a_controller_that_does_not_draw_lines_is_given_them_point_by_point():
    with device("gcs2") as (name, parameters, amplifier, _):
        s = WiredSession(name, parameters, amplifier)
        assert s.session.stage._axis.waves.draws_lines
        s.session.close()
    with device("gcs2") as (name, parameters, amplifier, (controller, _)):
        write = controller._wave.write

        def bends(words):
            if words[2].upper() == "LIN":
                words = [*words[:3], *words[3:4], str(2 * float(words[4])), *words[5:]]
            write(words)

        controller._commands["WAV"] = bends
        s = WiredSession(name, parameters, amplifier)
        assert not s.session.stage._axis.waves.draws_lines
        s.session.stage.set_voltage(TOP)
        s.session.close()
        check_wire(s.wire)


def test_the_default_slew_is_finite_and_lets_the_protocols_pass():
    from piezo_hysteresis.identification.protocol.drive_limits import DriveLimits
    from piezo_hysteresis.identification.protocol.protocol import paper, rich, short

    for period in (2e-5, PERIOD):
        driver = settings("simulated", max_slew_rate=0.0, sample_period=period)
        with device("simulated") as (_, parameters, _, _):
            s = WiredSession("simulated", parameters, max_slew_rate=0.0, sample_period=period)
        slew = s.session.limits.max_slew_rate
        assert slew == pytest.approx(0.4 * 10.0 / period)
        for protocol in (paper, short, rich):
            plan = protocol(DriveLimits(sample_period=period))
            assert plan.summary.largest_slew <= slew, "as without any limit"
            assert (
                plan.summary.largest_slew
                == protocol(DriveLimits(sample_period=period, max_slew_rate=slew)).summary.largest_slew
            )
        assert driver.ramp_rate <= slew
        s.end()


def test_a_stage_is_not_widened_by_its_driver():
    with device("simulated") as (_, parameters, _, _):
        with pytest.raises(ParameterError, match="voltage_min, voltage_max"):
            WiredSession("simulated", parameters, voltage_max=11.0)
        s = WiredSession("simulated", values("simulated"))
    with pytest.raises(StageError, match="expected them inside"):
        s.session.stage.restrict(replace(s.session.limits, voltage_max=20.0), RAMP)
    s.end()
