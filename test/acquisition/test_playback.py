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

"""Whatever is asked for, the drive stays inside its ramps, and every sample carries its phase."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from piezo_hysteresis.acquisition.drive import EventKind
from piezo_hysteresis.acquisition.playback import Playback
from piezo_hysteresis.acquisition.recorded_playback import RecordedPlayback
from piezo_hysteresis.errors import StageError

PERIOD = 1e-3


def playback(voltage=0.0, **changes):
    return Playback(voltage, **{"safe_voltage": 0.0, "sample_period": PERIOD, "ramp_rate": 100.0, **changes})


def taken(source, *counts):
    drives = [source.take(n) for n in counts]
    events, start = [], 0
    for drive in drives:
        events += [(start + e.offset, e.kind, str(e.phase)) for e in drive.events]
        start += drive.voltage.size
    return np.concatenate([d.voltage for d in drives]), np.concatenate([d.phase for d in drives]), events


def test_idle_keeps_the_present_voltage():
    voltage, phase, events = taken(playback(3.0), 5, 5)
    assert voltage.tolist() == [3.0] * 10
    assert phase.tolist() == [0] * 10
    assert events == [(0, EventKind.BEGAN, "0 idle")]


def test_waveform_is_played_exactly_and_then_held():
    p = playback()
    p.take(2)
    p.play(np.array([0.0, 1.0, 2.0]), "step", 17)
    voltage, phase, events = taken(p, 2, 4)
    assert voltage.tolist() == [0.0, 1.0, 2.0, 2.0, 2.0, 2.0]
    assert phase.tolist() == [1, 1, 1, 2, 2, 2]
    assert events == [(0, EventKind.BEGAN, "1 step"), (3, EventKind.DONE, "1 step"), (3, EventKind.BEGAN, "2 hold")]


def test_done_is_reported_with_the_block_that_ends_it():
    p = playback()
    p.play(np.zeros(4), "rest")
    assert [e.kind for e in p.take(4).events if e.phase.name == "rest"] == [EventKind.BEGAN, EventKind.DONE]
    assert [str(e.phase) for e in p.take(1).events] == ["2 hold"]


def test_a_command_named_hold_is_a_separate_phase():
    p = playback()
    p.play(np.zeros(1), "hold")
    assert taken(p, 2)[1].tolist() == [1, 2]


def test_ramp_reaches_the_set_point_exactly_at_the_ramp_rate():
    p = playback()
    p.take(1)
    p.ramp_to(0.35)
    assert p.pending == 4
    voltage, phase, _ = taken(p, 6)
    assert np.allclose(voltage, [0.1, 0.2, 0.3, 0.35, 0.35, 0.35], rtol=0, atol=1e-12)
    assert voltage[-1] == 0.35
    assert phase.tolist() == [1] * 6


def test_stop_leaves_the_waveform_at_the_ramp_rate():
    p = playback()
    p.take(1)
    p.play(np.linspace(0, 1, 101), "sine")
    p.take(51)
    p.stop()
    assert p.is_stopping
    with pytest.raises(StageError, match="safe voltage"):
        p.play(np.zeros(3), "next")
    voltage, _, events = taken(p, 3, 2)
    assert np.allclose(voltage, [0.4, 0.3, 0.2, 0.1, 0.0], rtol=0, atol=1e-12)
    assert events[0] == (0, EventKind.STOPPED, "1 sine")
    assert p.is_safe
    assert not p.is_stopping
    p.play(np.zeros(3), "next")


def test_stop_next_to_the_safe_voltage_ends_on_it():
    p = playback()
    p.play(np.array([1e-13]), "step")
    p.take(2)
    p.stop()
    assert p.take(3).voltage[-1] == 0.0
    assert p.is_safe


def test_commands_are_refused_while_one_is_played():
    p = playback()
    p.play(np.zeros(3), "first")
    for ask in (lambda: p.play(np.zeros(1), "second"), lambda: p.ramp_to(1.0)):
        with pytest.raises(StageError, match="'first' is being played"):
            ask()


@pytest.mark.parametrize("cut", [1, 3, 100])
def test_hold_timeout_counts_from_the_end_of_the_motion(cut):
    p = playback(hold_timeout=10 * PERIOD)
    p.play(np.array([0.0, 0.2]), "step")
    voltage, _, _ = taken(p, *[cut] * (100 // cut))
    assert np.allclose(voltage[:20], [0.0, 0.2] + [0.2] * 10 + [0.1] + [0.0] * 7, rtol=0, atol=1e-12)


def test_preview_does_not_consume_samples():
    p = playback()
    p.play(np.arange(5) / 10, "step")
    ahead = p.preview(7)
    again = p.take(7)
    assert np.array_equal(ahead.voltage, again.voltage)
    assert ahead.events == again.events


def test_a_jump_ends_the_present_waveform():
    p = playback()
    p.play(np.full(50, 0.05), "step")
    p.take(5)
    p.jump(0.0)
    voltage, _, events = taken(p, 5)
    assert voltage.tolist() == [0.0] * 5
    assert events[0][1:] == (EventKind.STOPPED, "1 step")
    assert not p.is_playing


actions = st.lists(
    st.one_of(
        st.tuples(st.just("take"), st.integers(1, 60)),
        st.tuples(st.just("ramp"), st.floats(-2, 2)),
        st.tuples(st.just("play"), st.lists(st.floats(-1, 1), min_size=1, max_size=40)),
        st.tuples(st.just("stop"), st.none()),
    ),
    max_size=30,
)


@given(actions, st.floats(0.0, 0.05), st.floats(-1, 1))
def test_no_step_is_steeper_than_the_ramp_or_the_waveform(script, hold_timeout, start):
    """Between two samples the drive moves by no more than ramp_rate·T_s, or by what a waveform accepted asks for."""
    p = playback(start, hold_timeout=hold_timeout)
    last, labels, numbers = p.voltage, {}, []
    for what, value in script:
        try:
            if what == "take":
                drive = p.take(value)
                labels.update({e.phase.number: e.phase for e in drive.events})
                steps = np.abs(np.diff(drive.voltage, prepend=last))
                commanded = np.array([labels[n].commanded for n in drive.phase.tolist()])
                assert (steps[~commanded] <= 100.0 * PERIOD * (1 + 1e-9)).all()
                numbers += drive.phase.tolist()
                last = drive.voltage[-1]
                assert p.voltage == last
            elif what == "ramp":
                p.ramp_to(value)
            elif what == "play":
                p.play(np.array(value), "w")
            else:
                p.stop()
        except StageError:
            assert p.is_playing or p.is_stopping
    assert numbers == sorted(numbers)


def test_a_recording_brings_its_own_phases():
    phases = (("rest", 3), ("step", 2))
    _, phase, events = taken(RecordedPlayback(phases, 0.0), 2, 2, 4)
    assert phase.tolist() == [1, 1, 1, 2, 2, 3, 3, 3]
    assert [e[::2] for e in events] == [(0, "1 rest"), (3, "2 step"), (5, "3 hold")]
    _, phase, events = taken(RecordedPlayback(phases, 0.0, repeat=True), 8)
    assert [e[::2] for e in events] == [(0, "1 rest"), (3, "2 step"), (5, "3 rest")]
