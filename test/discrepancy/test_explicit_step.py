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

"""A stage that effects explain is not taken for a simulation with the explicit step of Eq. (7)."""

from dataclasses import replace

import numpy as np

from piezo_hysteresis.discrepancy import diagnose
from piezo_hysteresis.effects import AmplifierBandwidth, Arx, BoucWen, RateDependentHysteresis
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Record


def test_a_stage_that_two_effects_explain_is_no_simulation():
    """Beside the pole of the amplifier alone, a loop that depends on speed leaves an error like that of the step."""
    effects = (RateDependentHysteresis(k=0.02, a=0.0), AmplifierBandwidth(tau=6e-4))
    loop = BoucWen(A=-0.77, beta=4.6, gamma=-0.87, p1=-0.11, p2=2.2)
    stage = Model((loop, *effects, Arx(a=(-1.2, 0.5), b=(0.3,), delay=2)), 1e-4, 10.0, 1e-5)
    random, t = np.random.default_rng(0), 1e-4 * np.arange(2000)
    fade = np.minimum(1.0, np.minimum(t, t[::-1]) / 0.02)

    def multisine(top):
        waves = sum(np.cos(2.0 * np.pi * (f * t + random.uniform())) for f in range(5, 1500, 10))
        return 4.0 + top * fade * waves / np.abs(waves).max()

    drives = [(f"sine_{f}hz", 2.8 * (1.0 - np.cos(2.0 * np.pi * f * t))) for f in (20, 100, 250, 400)]
    drives += [("triangle", a * (1.0 - np.abs(2.0 * (f * t % 1.0) - 1.0))) for a, f in ((8, 5), (6, 10), (4, 30))]
    drives += [("step", np.repeat([0.0, a, 4.0 * a, a], 500)) for a in (1.0, 0.6)]
    drives += [("multisine", multisine(top)) for top in (0.3, 0.3, 3.0, 3.0)]
    records = [Record(u, u, 1e-4, phase, initial_voltage=float(u[0])) for phase, u in drives]
    answers = zip(records, stage.simulate(records), strict=True)
    recorded = [replace(r, displacement=y + random.normal(0.0, 3e-9, y.size)) for r, y in answers]
    found = diagnose(recorded, effects=[type(e) for e in effects])
    assert set(found.names) == {e.name for e in effects}
    assert found.gap.after < 1.2 * found.gap.floor
