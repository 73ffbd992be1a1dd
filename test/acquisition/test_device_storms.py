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

"""Any fault at any command of an emulated device, in any order of motions: the wire keeps range, slew and ramp rate.

Hypothesis draws faults and motions from several seeds; it takes minutes: `-m soak`.
"""

from contextlib import suppress

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

from benchmarks.wire import PERIOD, RAMP, SAFE_WITHIN, TOP, WiredSession, check_wire, device
from piezo_hysteresis.emulators.daqmx.faults import FAULTS as NI
from piezo_hysteresis.emulators.gcs2.faults import FAULTS as GCS2
from piezo_hysteresis.errors import PiezoError

pytestmark = [pytest.mark.device, pytest.mark.soak]

pytest.importorskip("nidaqmx", reason="nidaqmx is not installed: pip install 'nidaqmx[grpc]'")

FAULTS = {"gcs2": GCS2, "nidaqmx": NI}
COMMANDS = {
    "gcs2": (
        "ERR? WAV #9 VOL? POS? DRR?",
        "SVO SVO? SVA WCL WAV? GWD? WSL WOS WGC WTR RTR DRC WGO #24 DRL?",
    ),
    "nidaqmx": (
        "WriteAnalogF64 ReadAnalogF64",
        "CreateTask CreateAOVoltageChan CreateAIVoltageChan CfgSampClkTiming StartTask ClearTask",
    ),
}
"""Commands of a device that are given for every block or chunk, and those that a motion gives once."""
VOLTAGES = st.sampled_from([0.0, 0.5, 1.0, 3.0, 5.5, TOP])
MOTIONS = st.lists(
    st.one_of(
        st.tuples(st.sampled_from(["play", "go"]), VOLTAGES),
        st.tuples(st.sampled_from(["stop", "cancel", "wait"]), st.just(0.0)),
    ),
    max_size=4,
).map(lambda motions: [("play", 3.0), *motions, ("wait", 0.0)])


STORM = settings(
    max_examples=25,
    deadline=None,
    phases=[Phase.generate],
    database=None,
    suppress_health_check=list(HealthCheck),
)


def faults_of(word):
    """One or two faults as texts, the first at a command that is given often."""
    kinds, (often_given, seldom_given) = st.sampled_from(sorted(FAULTS[word].meaning)), COMMANDS[word]
    often = st.builds("{}@{}:{}".format, kinds, st.sampled_from(often_given.split()), st.integers(1, 25))
    seldom = st.builds("{}@{}:{}".format, kinds, st.sampled_from(seldom_given.split()), st.integers(1, 3))
    return st.lists(seldom, max_size=1).flatmap(lambda second: often.map(lambda first: [first, *second]))


class Motions:
    """A session that carries out every command, whatever fails."""

    def __init__(self, session):
        self.session = session

    def play(self, voltage):
        """A line from where the stage is, no steeper than the ramp, and a short hold."""
        begin = self.session.acquisition.playback.voltage
        count = 2 + int(abs(voltage - begin) / (0.9 * RAMP * PERIOD))
        self.session.play(np.concatenate((np.linspace(begin, voltage, count), np.full(200, voltage))))

    def go(self, voltage):
        self.session.acquisition.ramp_to(voltage)

    def stop(self, _):
        self.session.acquisition.stop()
        with pytest.raises(PiezoError):
            self.go(1.0)
        self.session.session.latch.release()

    def cancel(self, _):
        self.session.acquisition.cancel()

    def wait(self, _):
        with suppress(TimeoutError):
            self.session.wait(lambda: self.session.failures or self.session.acquisition.playback.pending == 0, "", 3.0)


def strike(word, faults, motions):
    """Move, fail, end, and look at the wire sample by sample; whether the session has failed."""
    with device(word) as (name, parameters, amplifier, (emulated, _)):
        s = WiredSession(name, parameters | {"timeout": 1.0}, amplifier)
        s.start()
        # its motion and its recorder have the same object
        emulated.faults.__init__([FAULTS[word].parse(fault) for fault in faults])
        for motion, voltage in motions:
            with suppress(PiezoError):  # refused: it has failed, or is under way
                getattr(Motions(s), motion)(voltage)
        messages = list(s.failures)
        for end in (s.session.make_safe, s.session.close):
            try:
                end()
            except PiezoError as error:
                messages.append(error)
        output, wire = s.output, s.wire
        s.end()
        check_wire(wire)
        if abs(output) > SAFE_WITHIN:
            assert any("unknown" in str(message) for message in [*messages, *s.failures]), (output, messages)
        assert all(isinstance(failure, PiezoError) and "\n" not in str(failure) for failure in s.failures)
        assert not any("fault of the driver" in str(failure) for failure in s.failures), s.failures
        return bool(s.failures)


@pytest.mark.parametrize("number", [1, 2, 3])
@pytest.mark.parametrize("word", ["gcs2", "nidaqmx"])
def test_whatever_fails_and_whenever_the_wire_keeps_its_limits(word, number):
    @seed(number)
    @settings(
        max_examples=25, deadline=None, phases=[Phase.generate], database=None, suppress_health_check=list(HealthCheck)
    )
    @given(faults_of(word), MOTIONS)
    def storm(faults, motions):
        failed.append(strike(word, faults, motions))

    failed = []
    storm()
    assert sum(failed) > len(failed) / 10, "most of the faults came in when nothing was asked"
