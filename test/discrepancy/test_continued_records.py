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

"""Records that continue one another, as the nodes and `piezo simulate` record them: what is named, is as hidden."""

import json

import numpy as np
import pytest

from piezo_hysteresis.cli.main import main
from piezo_hysteresis.discrepancy import diagnose
from piezo_hysteresis.recording import read
from piezo_hysteresis.stage.plant.hysteresis import Hysteresis

pytestmark = pytest.mark.soak
CORNER = 10e3
"""Corner of the amplifier of every simulated stage [Hz]."""
GAIN = 20.0
"""Gain of this amplifier."""


def simulated(folder, seed):
    """The experiment of `piezo simulate`, and the hidden parameters of its stage."""
    command = ["simulate", "--protocol", "rich", "--hidden", str(seed)]
    main([*command, "-o", str(folder / "rich"), "--truth", str(folder / "truth.json")])
    return read(folder / "rich"), json.loads((folder / "truth.json").read_text())["changes"]


def test_the_lag_beside_a_backlash_is_found_and_both_are_as_hidden(tmp_path):
    """The dynamics contain a part of the pole, and the backlash took the rest: it was 14 % too large."""
    experiment, truth = simulated(tmp_path, 1)
    found = diagnose(experiment)
    assert found.names == ("backlash", "amplifier_bandwidth")
    low, high = found.fit.interval("backlash.b")
    assert low < truth["hysteresis.backlash"] < high
    (pole,) = (n for n in found.fit.names if n.endswith(".tau"))
    low, high = found.fit.interval(pole)
    assert low < 1.0 / (2.0 * np.pi * CORNER) < high
    assert found.gap.after < 1.1 * found.gap.floor


def test_a_lag_is_named_although_the_records_on_average_are_at_the_floor(tmp_path):
    experiment, truth = simulated(tmp_path, 12)
    found = diagnose(experiment)
    assert found.names == ("amplifier_bandwidth",)
    assert not any("amplifier_bandwidth_held" in reason for reason in found.rejected.values())
    (pole,) = (n for n in found.fit.names if n.endswith(".tau"))
    low, high = found.fit.interval(pole)
    assert low < 1.0 / (2.0 * np.pi * truth["electronics.amplifier_bandwidth"]) < high
    assert found.gap.after < 1.1 * found.gap.floor


def test_a_largest_slope_and_the_pole_of_its_amplifier_are_as_hidden(tmp_path):
    """The slope without the pole left 1.6 floors, and its interval excluded the truth."""
    experiment, truth = simulated(tmp_path, 4)
    found = diagnose(experiment)
    assert found.names == ("amplifier_slew_limit",)
    low, high = found.fit.interval("amplifier_slew_limit_settling.S")
    assert low < truth["electronics.amplifier_slew"] / GAIN < high
    low, high = found.fit.interval("amplifier_slew_limit_settling.tau")
    assert low < 1.0 / (2.0 * np.pi * CORNER) < high
    assert found.gap.after < 1.1 * found.gap.floor


def test_a_loop_that_follows_the_speed_late_is_as_hidden(tmp_path):
    """Without the lag, 1.9 floors were left, and the interval of the exponent excluded the truth."""
    experiment, truth = simulated(tmp_path, 24)
    found = diagnose(experiment)
    assert found.names == ("rate_dependent_hysteresis",)
    stage = Hysteresis()
    hidden = {"k": truth["hysteresis.rate_gain"], "a": stage.rate_exponent, "tau": stage.rate_time}
    for name, value in hidden.items():
        low, high = found.fit.interval(f"rate_dependent_hysteresis_lagged.{name}")
        assert low < value < high
    assert found.gap.after < 1.2 * found.gap.floor


def test_a_drift_is_named_beside_dynamics_that_could_imitate_it(tmp_path):
    experiment, truth = simulated(tmp_path, 11)
    found = diagnose(experiment)
    assert found.names == ("gain_drift",)
    for name, hidden in (("g", truth["environment.gain_per_kelvin"]), ("tau", truth["environment.temperature_time"])):
        low, high = found.fit.interval(f"gain_drift.{name}")
        assert low < hidden < high
