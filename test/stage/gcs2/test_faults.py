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

"""Whatever fails: one clear error, the safe voltage where the link allows, and what is not known is said."""

import time

import numpy as np
import pytest

from piezo_hysteresis.emulators.fault import Fault
from piezo_hysteresis.emulators.gcs2.faults import FAULTS
from piezo_hysteresis.errors import StageError
from piezo_hysteresis.stage.gcs2.stage import Gcs2Stage

WAVE = 4.0 - 4.0 * np.cos(2 * np.pi * np.arange(1200) / 600)
WAY = "SVO:1 SVO?:1 SVA:1 VOL?:2 WCL:1 WAV:3 WAV?:1 GWD?:2 WSL:1 WTR:1 RTR:1 DRC:2 WGO:1 #9:1 DRL?:1 DRR?:2 POS?:1"
"""Every kind of step between the first set-point and the last sample."""


def work(stage, play):
    stage.set_voltage(1.0)
    record = play(stage, 1.0 + WAVE)
    stage.read_displacement()
    return record


@pytest.mark.parametrize("step", WAY.split())
def test_a_link_lost_at_any_step_ends_at_the_safe_voltage(bench, play, step):
    b = bench(f"link_lost@{step}", rows_per_answer=500)
    with pytest.raises(StageError, match=r"link.*brought to its safe voltage, 0 V"):
        work(b.stage, play)
    assert b.voltage == 0.0
    work(b.stage, play)  # over the new link


@pytest.mark.parametrize("step", ["ERR?:20", "WGO:1", "GWD?:2", "DRR?:2"])
def test_a_link_reset_in_mid_stream_ends_at_the_safe_voltage(bench, play, step):
    b = bench(f"reset@{step}", rows_per_answer=500)
    with pytest.raises(StageError, match=r"(Connection reset|the link was closed).*brought to its safe voltage, 0 V"):
        work(b.stage, play)
    assert b.voltage == 0.0
    work(b.stage, play)  # over the new link


@pytest.mark.parametrize("step", ["VOL?:2", "WAV?:1", "DRR?:2"])
def test_a_lost_link_leaves_the_voltage_unknown_and_is_reported(bench, play, step):
    b = bench(f"gone@{step}", rows_per_answer=500)
    with pytest.raises(StageError, match=r"voltage of the stage is unknown.*switch the amplifier off"):
        work(b.stage, play)
    with pytest.raises(StageError, match="cannot connect"):
        b.stage.close()
    b.stage.close()


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("partial_answer", r"the answer stopped after \d+ bytes"),
        ("partial_answer@ERR?:30", "no answer within 1 s|stopped after"),
        ("slow@POS?=5", r"no answer within 1 s to 'POS\? 1'"),
        ("slow@WGO=5", "no answer within 1 s to ERR"),
        ("trickle@POS?=0.5", r"the answer stopped after [1-3] bytes, expected its end within 1 s"),
        ("trickle@DRR?=0.5", r"the answer stopped after [1-3] bytes, expected its end within 1 s"),
        ("absurd@POS?=1e300", r"got '1e\+300' to 'POS\? 1', expected a number from -.* to "),
        ("absurd@POS?=-5000", r"got '-5000' to 'POS\? 1', expected a number from -.* to "),
        ("absurd@VOL?:2=-5000", r"got '-5000' to 'VOL\? 1', expected a number from -100 to 300"),
        ("error@WAV:3=3", r"refused 'WAV 1 & PNT 201 .*error 3 \(the command is too long; lower points_per_command"),
        ("error@DRR?=77", "no answer.*it holds error 77"),
        ("error@SVA=555", "error 555"),
        ("garbled", r"row \d+ of \d+ is '.*nan.*', expected 2 finite numbers"),
        ("garbled@VOL?:2", "expected a number"),
        ("garbled@ERR?:16", "expected an error number"),
        ("short_record", "table 1 holds 960 samples, expected 1200"),
        ("wrong_servo_time", "recorded every 0.0001 s, expected 5e-05 s; check the servo time"),
        ("saturated", r"measured a drive of 5\S* V at sample \d+, expected 9 V .*saturated"),
        ("stale@WGO", "displacement stayed at exactly"),
        ("duplicated", "the same 500 recorded samples twice"),
        ("swapped", "channels are exchanged"),
        ("servo_on", "servo of axis 1 is on after it was switched off"),
        ("servo_on@WGO", "servo of axis 1 is on after the run"),
    ],
)
def test_every_failure_is_reported_clearly_and_ends_safe(bench, play, fault, message):
    b = bench(fault, rows_per_answer=500, timeout=1.0 if "answer" in message else 5.0)
    with pytest.raises(StageError, match=message) as raised:
        work(b.stage, play)
    assert "\n" not in str(raised.value)
    if fault.startswith("servo_on"):
        assert "voltage of the stage is unknown" in str(raised.value), (
            "an open-loop move is refused while the servo is on"
        )
    else:
        assert "brought to its safe voltage, 0 V" in str(raised.value)
        assert b.voltage == 0.0


def test_channels_apart_by_one_sample_cannot_be_seen_and_are_a_delay(bench, play, ideal):
    straight, late = (play(bench(*faults, plant=ideal()).stage, WAVE) for faults in ((), ("skewed",)))
    np.testing.assert_array_equal(late.displacement[1:], straight.displacement[:-1])
    np.testing.assert_array_equal(late.voltage, straight.voltage)


def test_a_waveform_that_was_not_stored_as_sent_is_not_played(bench, play):
    b = bench("garbled@GWD?")
    with pytest.raises(StageError, match=r"GWD\?"):
        play(b.stage, WAVE)
    assert not any(line.startswith("WGO 1 1") for line in b.controller.heard)


def test_no_device_at_the_address(bench):
    b = bench(opened=False)
    setup = b.setup()
    b.server.close()
    with pytest.raises(StageError, match=r"cannot connect.*check address, cable, power"):
        Gcs2Stage(setup)


def test_only_known_faults_can_be_injected():
    for kind in FAULTS.meaning:
        assert FAULTS.parse(kind).kind == kind
    assert FAULTS.parse("error@sva:3=79") == Fault("error", "SVA", 3, 79.0)
    for wrong in ("earthquake", "slow@POS?:x", "slow=fast"):
        with pytest.raises(StageError, match="expected"):
            FAULTS.parse(wrong)


@pytest.mark.parametrize(
    "answer",
    [
        "VMA?=1e300",
        "VMI?=-1e300",
        "VMA?=-5000",
        "VOL?=-5000",
        "SPA?=1e-320",
        "SPA?=1e6",
        "TNR?=1e300",
        "WMS?=-1",
        "TMX?=1e300",
    ],
)
def test_an_impossible_answer_is_refused_while_opening_and_nothing_moves(bench, answer):
    b = bench(f"absurd@{answer}", opened=False)
    with pytest.raises(StageError, match=r"expected (a number from|a range)") as refusal:
        Gcs2Stage(b.setup())
    assert "\n" not in str(refusal.value)
    assert not any(line.startswith(("SV", "WGO", "\x18")) for line in b.controller.heard)


@pytest.mark.parametrize("step", ["*IDN?", "HLP?", "SAI?", "SPA?", "VMI?", "TNR?", "WMS?", "VOL?", "ERR?:4"])
def test_a_link_lost_while_opening_is_reported_and_moves_nothing(bench, step):
    b = bench(f"link_lost@{step}", opened=False)
    b.controller.carry_out("SVA 1 60")
    b.controller.heard.clear()
    with pytest.raises(StageError, match="the link was closed from the other side"):
        Gcs2Stage(b.setup())
    assert b.voltage == pytest.approx(3.0, abs=1e-3)
    assert not any(line.startswith(("SV", "W", "\x18")) for line in b.controller.heard if not line.startswith("WMS?"))


def test_the_error_queue_is_read_after_every_command(bench, play):
    b = bench()
    b.controller.heard.clear()
    work(b.stage, play)
    b.stage.close()
    heard = [line.strip() for line in b.controller.heard if line != "\x09"]
    assert len(heard) > 50
    for line, following in zip(heard, [*heard[1:], ""], strict=True):
        assert line == "ERR?" or following == "ERR?", line


def test_waiting_takes_no_processor_time(bench):
    b = bench("slow@POS?=0.6")
    before = time.thread_time()
    b.stage.read_displacement()
    assert time.thread_time() - before < 0.1
