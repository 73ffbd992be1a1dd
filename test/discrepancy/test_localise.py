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

"""Where: each kind of residual concentrates on the axis that reveals it."""

from dataclasses import replace

import numpy as np
import pytest

from piezo_hysteresis.discrepancy.localise import localise, located
from piezo_hysteresis.effects import Arx, Softening
from piezo_hysteresis.errors import DivergenceError
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Record

RANDOM = np.random.default_rng(9)
PERIOD = 1e-3
AXES = {
    "phase",
    "frequency",
    "amplitude",
    "direction",
    "turning_point_distance",
    "time_since_level_change",
    "absolute_time",
}


def staircase(start_time=0.0):
    u = np.repeat([0.0, 2.0, 4.0, 6.0, 4.0, 2.0], 5000)
    return Record(u, np.zeros(u.size), PERIOD, "staircase", start_time)


def triangle(start_time=0.0):
    t = PERIOD * np.arange(8000)
    return Record(6 * np.abs(2 * (t / 2 % 1) - 1), np.zeros(t.size), PERIOD, "triangle", start_time)


RECORDS = (triangle(0.0), staircase(10.0), triangle(45.0), staircase(55.0))


def places(residual):
    """Places by axis, and the axis with the largest share."""
    left = [np.asarray(residual(r), float) for r in RECORDS]
    found = localise(RECORDS, left, [1e-8] * len(RECORDS))
    return {p.axis: p for p in found}, found[0].axis


def since_level(record):
    changed = np.flatnonzero(np.diff(record.voltage, prepend=record.voltage[0]))
    last = np.concatenate(([0], changed))[np.searchsorted(changed, np.arange(record.size), side="right")]
    return PERIOD * (np.arange(record.size) - last)


def test_shares_add_up_on_every_axis():
    by_axis, _ = places(lambda r: RANDOM.normal(size=r.size))
    assert set(by_axis) == AXES
    for place in by_axis.values():
        assert sum(share for _, share in place.bins) == pytest.approx(1.0)
        assert 0.0 <= place.share <= 1.0


def test_creep_lies_late_after_a_change_of_level():
    by_axis, _ = places(lambda r: np.log10(1 + since_level(r) / 0.1) * 1e-8)
    place = by_axis["time_since_level_change"]
    late = sum(s for label, s in place.bins if float(label.split()[0]) >= 1.0)
    assert late > 0.6
    by_phase = dict(by_axis["phase"].bins)
    assert by_phase["staircase"] > 0.95


def test_an_error_of_one_direction_shows_there():
    by_axis, _ = places(lambda r: 1e-8 * (np.diff(r.voltage, prepend=r.voltage[0]) > 1e-4))
    assert dict(by_axis["direction"].bins)["rising drive"] == pytest.approx(1.0)
    assert by_axis["direction"].detail.startswith("rising drive")


def test_an_error_at_the_top_of_the_range_shows_there():
    by_axis, _ = places(lambda r: 1e-8 * (r.voltage > 5.5))
    assert dict(by_axis["amplitude"].bins)["90 to 100 % of the drive range"] > 0.9


def test_a_drift_grows_with_absolute_time():
    by_axis, _ = places(lambda r: 1e-10 * r.time)
    shares = [s for _, s in by_axis["absolute_time"].bins]
    assert sum(shares[5:]) > 0.85


def test_a_line_shows_in_its_band_before_anything_else():
    by_axis, first = places(lambda r: 1e-8 * np.sin(2 * np.pi * 50 * r.time))
    assert first == "frequency"
    assert by_axis["frequency"].detail.startswith("25 to 75 Hz")
    assert by_axis["frequency"].share > 0.99


@pytest.mark.parametrize("size", [1000, 1001])
def test_a_constant_and_a_line_of_one_power_have_the_same_share_of_the_frequencies(size):
    record = Record(np.linspace(0.0, 6.0, size), np.zeros(size), PERIOD, "triangle")
    wave = np.sqrt(2.0) * np.cos(2.0 * np.pi * round(0.1 * size) * np.arange(size) / size)
    (place,) = (p for p in localise([record], [1.0 + wave], [1e-8]) if p.axis == "frequency")
    assert [share for _, share in place.bins if share > 1e-9] == pytest.approx([0.5, 0.5])


def test_the_nyquist_frequency_counts_once():
    size = 4
    record = Record(np.linspace(0.0, 6.0, size), np.zeros(size), 1e-3, "triangle")
    nyquist = np.array([1.0, -1.0, 1.0, -1.0])
    (place,) = (p for p in localise([record], [1.0 + nyquist], [1e-8]) if p.axis == "frequency")
    assert [share for _, share in place.bins if share > 1e-9] == pytest.approx([0.5, 0.5])


def test_an_error_just_after_turning_points_shows_there():
    def residual(record):
        u = record.voltage
        distance = np.minimum(u, 6 - u) if record.phase == "triangle" else np.full(u.size, 9.0)
        return 1e-8 * (distance < 0.5)

    by_axis, _ = places(residual)
    nearest = dict(by_axis["turning_point_distance"].bins)["0 to 10 % of the drive range after a turning point"]
    assert nearest > 0.4


def test_zero_residual_has_no_location():
    assert localise(RECORDS, [np.zeros(r.size) for r in RECORDS], [1e-8] * 4) == ()


@pytest.mark.parametrize("low", [-40.0, 50.0])
def test_the_drive_range_of_all_records_is_divided(low):
    """Also if it does not begin at 0 V, or if a record uses only its upper half."""
    whole = np.linspace(low, low + 50.0, 1000)
    records = [Record(u, np.zeros(u.size), 1e-3, "triangle") for u in (whole, whole[500:])]
    shares = localise(records, [np.zeros(1000), np.ones(500)], [1e-9, 1e-9])
    (place,) = (p for p in shares if p.axis == "amplitude")
    assert [share for _, share in place.bins] == pytest.approx([0.0] * 5 + [0.2] * 5, abs=0.01)


def test_a_record_that_is_not_used_is_not_simulated():
    """The model may diverge there; a record that is continued determines the state of the next one."""
    soft = Model((Arx(a=(-1.5, 0.9), b=(0.4,)), Softening(k3=-0.08)), 1e-3, 1.0, 1e-6)
    small, far = (Record(np.linspace(0.0, top, 100), np.zeros(100), 1e-3) for top in (0.1, 1e3))
    with pytest.raises(DivergenceError):
        located(soft, (small, far), (0, 1), (1e-9, 1e-9))
    assert located(soft, (small, far), (0,), (1e-9, 1e-9))
    with pytest.raises(DivergenceError):
        located(soft, (far, replace(small, continues=True)), (1,), (1e-9, 1e-9))
