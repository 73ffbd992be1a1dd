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

"""Commands that reach a memory stage while it plays a block: the voltage makes no step, and the last one is reached."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from piezo_hysteresis.acquisition.drive import EventKind
from piezo_hysteresis.acquisition.memory import MemoryAcquisition
from piezo_hysteresis.errors import StageError
from piezo_hysteresis.stage.simulated import SimulatedMemoryStage

from .test_streaming import PERIOD, RAMP_RATE, play, started

LSB = 10.0 / 2**15
"""Resolution of the converter of the simulated stage [V]."""
MOMENTS = ("upload", "arm", "start", "wait", "read")


class Interrupted(SimulatedMemoryStage):
    """Keeps every voltage that it puts out, and calls `meanwhile` in each of its steps."""

    def __init__(self, **options):
        super().__init__(sample_period=PERIOD, dead_time=0.0, **options)
        self.meanwhile, self.parts = lambda moment: None, [np.zeros(1)]
        run = self._plant.run
        self._plant.run = lambda voltage: (self.parts.append(np.array(voltage)), run(voltage))[1]

    @property
    def wire(self):
        return np.concatenate(self.parts)


def at(moment):
    def step(self, *arguments):
        self.meanwhile(moment)
        return getattr(SimulatedMemoryStage, moment)(self, *arguments)

    return step


for name in MOMENTS:
    setattr(Interrupted, name, at(name))


def arrives(stage, acquisition, listener, voltage):
    listener.wait(lambda heard: heard.failures or acquisition.playback.voltage == voltage)
    assert not listener.failures
    listener.wait(lambda heard: heard.deliveries[-1].block.voltage[-1] == pytest.approx(voltage, abs=1e-3))
    assert acquisition.playback.voltage == voltage
    assert stage.voltage == pytest.approx(voltage, abs=LSB)


@given(
    st.floats(0.1, 10.0),
    st.lists(st.tuples(st.integers(0, 9), st.floats(0.0, 10.0)), max_size=5),
    st.sampled_from([30, 100_000]),
)
@settings(max_examples=12, deadline=None)
def test_whatever_set_points_arrive_during_a_ramp(first, later, longest):
    stage = Interrupted(longest_block=longest)
    acquisition, listener = started(stage, MemoryAcquisition, rest_period=1e-3)
    goals, count = sorted(later), iter(range(1 << 30))
    sent = [first]

    def meanwhile(moment):
        now = next(count)
        while goals and goals[0][0] <= now:
            sent.append(goals.pop(0)[1])
            acquisition.ramp_to(sent[-1])

    stage.meanwhile = meanwhile
    acquisition.ramp_to(first)
    listener.wait(lambda heard: heard.failures or acquisition.playback.voltage == sent[-1])
    stage.meanwhile = lambda moment: None
    arrives(stage, acquisition, listener, sent[-1])
    acquisition.ramp_to(1.0)
    arrives(stage, acquisition, listener, 1.0)
    assert np.abs(np.diff(stage.wire)).max() <= RAMP_RATE * PERIOD + LSB
    assert acquisition.make_safe(30.0)
    assert stage.voltage == 0.0


@pytest.mark.parametrize("moment", MOMENTS)
def test_a_waveform_during_a_ramp_is_refused_and_the_ramp_goes_on(moment):
    stage = Interrupted()
    acquisition, listener = started(stage, MemoryAcquisition, rest_period=1e-3)
    refused = []

    def meanwhile(now):
        if now == moment:
            with pytest.raises(StageError, match="on its way to another voltage") as error:
                play(acquisition, [0.0] * 10, "early")
            refused.append(error)

    stage.meanwhile = meanwhile
    acquisition.ramp_to(2.0)
    arrives(stage, acquisition, listener, 2.0)
    assert len(refused) == 1
    stage.meanwhile = lambda now: None
    play(acquisition, [2.0] * 10, "late")
    listener.wait(lambda heard: "late" in heard.events(EventKind.DONE))
    assert acquisition.make_safe(30.0)


@pytest.mark.parametrize("moment", MOMENTS)
def test_a_stop_after_a_set_point_forgets_it(moment):
    stage = Interrupted()
    acquisition, listener = started(stage, MemoryAcquisition, rest_period=1e-3)
    cancelled = []

    def meanwhile(now):
        if now == moment:
            acquisition.ramp_to(3.0)
            cancelled.append(acquisition.cancel())

    stage.meanwhile = meanwhile
    acquisition.ramp_to(2.0)
    listener.wait(lambda heard: cancelled and acquisition.playback.is_safe)
    arrives(stage, acquisition, listener, 0.0)
    stage.meanwhile = lambda now: None
    acquisition.ramp_to(1.0)
    arrives(stage, acquisition, listener, 1.0)
    assert acquisition.make_safe(30.0)
