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

"""Compensation through a controller with memory and a streaming card: what their wires put out, sample by sample."""

import numpy as np
import pytest

from benchmarks.wire import LSB, PERIOD, RAMP, SLEW, TOP, device, values
from piezo_hysteresis.nodes.messages.conversions import values_of

from .test_compensation_node import MODEL, STROKE, Compensation, scan

pytestmark = [pytest.mark.nodes, pytest.mark.device]

pytest.importorskip("nidaqmx", reason="nidaqmx is not installed: pip install 'nidaqmx[grpc]'")


@pytest.mark.parametrize("word", ["gcs2", "nidaqmx"])
def test_every_sample_on_the_wire_is_inside_range_and_slew(lab, word):
    with device(word) as (_, parameters, amplifier, _):
        usual = values(word)
        own = {f"{word}__{name}": value for name, value in parameters.items() if value != usual[name]}
        limits = {"voltage_max": TOP, "max_slew_rate": SLEW, "ramp_rate": RAMP, "sample_period": PERIOD}
        patient = {"nidaqmx__lead": 3.0} if word == "nidaqmx" else {}  # on a busy machine a card runs out of samples
        driver = {"stage": word, "block_duration": 0.1, **limits, **own, **patient}
        wrong = MODEL.with_values({"bouc_wen.p2": 1.05 * MODEL.values()["bouc_wen.p2"]})
        node = Compensation(lab, wrong, driver=driver, way_back=0.1, learning_rounds=1)
        still = amplifier.wire.size
        node.send(scan(0.1, 0.4, frequency=120.0), "steep")
        assert "max_slew_rate" in node.until("steep", "refused").message
        node.send(scan(0.1, 0.9), "high")
        assert "voltage_max" in node.until("high", "refused").message
        assert np.ptp(amplifier.wire[still - 1 :]) <= 2 * LSB, "nothing moves"
        node.send(scan(0.1, 0.4))
        done = values_of(node.until("scan", "done"))
        lab.wait(lambda: abs(amplifier.output) < 2 * LSB, "the way back")
        before = len(node.statuses)
        assert node.ask("learn").success
        ended = lab.wait(
            lambda: [s for s in node.statuses[before:] if values_of(s)["state"] in ("done", "failed")], "learning"
        )
        assert values_of(ended[0])["state"] == "done", ended[0].message
        assert float(values_of(ended[0])["best"]) < 0.5 * float(done["rms"]) < 0.025 * STROKE
        lab.wait(lambda: abs(amplifier.output) < 2 * LSB, "the safe voltage")
        wire = amplifier.wire
    assert wire.max() > 2.0, "it did move"
    assert wire.min() >= -LSB and wire.max() <= TOP + LSB
    assert np.abs(np.diff(wire)).max() <= SLEW * PERIOD + 2 * LSB
