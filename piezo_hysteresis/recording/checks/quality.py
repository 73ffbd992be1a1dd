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

"""Checks of the data of an experiment; the findings are reported before the data are used."""

from __future__ import annotations

import re

import numpy as np

from ...record import Experiment, Notice, Record, Samples
from ..segmentation.waveform import phase_name
from ..table.units import REVERSED
from .channel_defects import channel_defects
from .initial_condition_check import not_at_rest, origins
from .lag import lag_notices
from .swapped import swapped

DISPLACEMENT_RANGE = (1e-9, 2e-3)
"""Range of displacement that a piezo stage can have [m]."""
VOLTAGE_RANGE = (1e-3, 1.2e3)
"""Largest drive voltage that a piezo stage can have [V]."""

GAIN_RANGE = (1e-10, 3e-4)
"""Range of displacement per volt that a piezo stage can have, with or without an amplifier [m/V]."""
USUAL_STROKE, USUAL_VOLTAGE, USUAL_GAIN = 20e-6, 30.0, 2e-7
"""Stroke [m], largest voltage [V] and displacement per volt [m/V] of a usual stage. The factor that a unit is off by is
found for strokes of 0.6 to 600 µm, voltages of 1 V to 1 kV, and 6 nm/V to 6 µm/V."""
FAINT = (4e-8, 1e-12)
"""A displacement per volt below the first value [m/V] with noise below the second [m] suggests a wrong unit."""

_SCALE_MISMATCH = 100.0
"""Ratio of two gains from which a unit must be wrong."""
_FEWEST_PERIODS = 1.8
"""Periods from which the frequency of a sine is known."""
_FREQUENCY_MISMATCH = 0.1
"""Relative difference of the frequency from the one in the phase name."""
_MOVING = 0.05
"""Share of the largest range of the drive from which a record counts as driven."""
_REVERSED = -0.9
"""Correlation of the channels up to which the displacement falls when the voltage rises."""
_SINE = re.compile(r"sine_(\d+(?:\.\d+)?(?:e[+-]?\d+)?)hz")
"""Phase name of a sine, with its frequency [Hz]."""


def inspect(experiment: Experiment, unit: str | float | None = None) -> tuple[Notice, ...]:
    """Check every channel of every record, and compare the records with each other.

    Parameters
    ----------
    experiment : Experiment
        Records in SI units.
    unit : str or float, optional
        Unit of the displacement that was given to the reader.

    Returns
    -------
    tuple of Notice
        Kinds: ``units``, ``scale``, ``constant``, ``sample_period``, ``time_base``, ``clipped``, ``stuck``,
        ``dropout``, ``quantisation``, ``leads``, ``late``, ``polarity``, ``not_at_rest``,
        ``origins_differ``. The findings of the readers (``gap``, ``duplicate``, …) are in `Experiment.notices`.
    """
    spans = np.array([[np.ptp(r.voltage), np.ptp(r.displacement)] for r in experiment])
    largest = float(spans[:, 0].max())
    moving = [r for r, (u, _) in zip(experiment, spans, strict=True) if u > _MOVING * largest]
    notices = [*_units(experiment, spans), *_scale(experiment, spans), *_order(experiment)]
    for record in moving:
        notices += _named_frequency(record)
        notices += channel_defects(record)
    late = lag_notices(moving)
    leading = {notice.phase for notice in late if notice.kind == "leads"}
    notices += late
    notices += [found for record in moving if record.phase not in leading and (found := swapped(record))]
    notices += _polarity(moving, unit)
    for record in experiment:
        notices += not_at_rest(record)
    return (*notices, *origins(experiment))


def _units(experiment: Experiment, spans: Samples) -> list[Notice]:
    u_span, y_span = (float(span) for span in spans.max(axis=0))
    u_peak = max(float(np.abs(r.voltage).max()) for r in experiment)
    notices = []
    if u_span == 0.0:
        notices.append(Notice("constant", "the voltage never changes; check that the stage was driven", severe=True))
    elif not VOLTAGE_RANGE[0] <= u_peak <= VOLTAGE_RANGE[1]:
        text = f"largest voltage {u_peak:.3g} V, expected 1 mV to 1.2 kV{_likely(u_peak, USUAL_VOLTAGE)}"
        notices.append(Notice("units", text, severe=True))
    if y_span == 0.0:
        notices.append(
            Notice("constant", "the displacement never changes; check the sensor and the column", severe=True)
        )
    elif not DISPLACEMENT_RANGE[0] <= y_span <= DISPLACEMENT_RANGE[1]:
        text = f"range of displacement {y_span:.3g} m, expected 1 nm to 2 mm{_likely(y_span, USUAL_STROKE)}"
        notices.append(Notice("units", text, severe=True))
    return notices or _gain(experiment, y_span / u_span)


def _gain(experiment: Experiment, gain: float) -> list[Notice]:
    """Notice about the displacement per volt, where each channel alone looks normal."""
    if not GAIN_RANGE[0] <= gain <= GAIN_RANGE[1]:
        text = f"displacement per volt {gain:.2g} m/V, expected 0.1 nm/V to 300 µm/V{_likely(gain, USUAL_GAIN)}"
        return [Notice("units", text)]
    parts = [r.displacement[_excerpt(r)] for r in experiment if r.size > 8]
    noise = min((float(np.median(np.abs(np.diff(y, 3)))) / 3.0 for y in parts), default=0.0)
    if gain < FAINT[0] and 0.0 < noise < FAINT[1]:
        text = (
            f"displacement per volt {gain:.2g} m/V with a noise of {noise:.1g} m: a unit may be "
            "wrong by a factor of 1000"
        )
        return [Notice("units", text)]
    return []


def _likely(value: float, usual: float) -> str:
    """The power of a thousand that brings a value nearest to the usual one."""
    power = 3 * round(float(np.log10(usual) - np.log10(value)) / 3)
    return f"; a unit may be off by 1e{power:+d}" if power else ""


def _scale(experiment: Experiment, spans: Samples) -> list[Notice]:
    """Phases whose gain is far from that of the others."""
    driven = spans[:, 0] > _MOVING * spans[:, 0].max()
    if not driven.any() or spans[:, 0].max() == 0.0:
        return []
    gains = np.where(driven, spans[:, 1] / np.where(driven, spans[:, 0], 1.0), np.nan)
    usual = float(np.nanmedian(gains))
    notices = []
    for record, gain in zip(experiment, gains, strict=True):
        if gain == 0.0 and usual > 0.0:
            notices.append(
                Notice("constant", "the displacement stands still while the drive moves", record.phase, True)
            )
        elif usual > 0.0 and not 1 / _SCALE_MISMATCH < gain / usual < _SCALE_MISMATCH and not np.isnan(gain):
            power = 3 * round(float(np.log10(gain / usual)) / 3)
            text = f"displacement per volt is 1e{power:+d} times that of the other phases; its unit may differ"
            notices.append(Notice("scale", text, record.phase, severe=True))
    return notices


def _order(experiment: Experiment) -> list[Notice]:
    """Phases that begin before the end of the previous one."""
    starts = [r.start_time for r in experiment]
    if sorted(set(starts)) != starts:
        return []  # the phases have no common clock
    notices = []
    for before, after in zip(experiment.records, experiment.records[1:], strict=False):
        overlap = before.start_time + before.duration - after.start_time
        if overlap > max(0.01 * before.duration, 2 * before.sample_period):
            text = f"begins {overlap:.3g} s before the end of the previous phase; check start times and sample periods"
            notices.append(Notice("time_base", text, after.phase))
    return notices


def _named_frequency(record: Record) -> list[Notice]:
    """Notice where the frequency in the name of a sine differs from that of its drive."""
    named, found = _SINE.fullmatch(record.phase), _SINE.fullmatch(phase_name(record.voltage, record.sample_period))
    if named is None or found is None or (periods := float(found[1]) * record.duration) < _FEWEST_PERIODS:
        return []  # in a single period the ends influence the frequency
    if abs(float(found[1]) / float(named[1]) - 1) < _FREQUENCY_MISMATCH + 0.5 / periods:
        return []  # half a period of rest or of another drive
    text = f"the drive moves at {found[1]} Hz; the name or the sample period {record.sample_period:g} s is wrong"
    return [Notice("sample_period", text, record.phase, severe=True)]


def _excerpt(record: Record) -> slice:
    return slice(0, min(record.size, 1 << 18))


def _fundamental(record: Record) -> tuple[float, float]:
    """Strongest frequency of the drive and the resolution of the estimate [Hz]."""
    u = record.voltage[_excerpt(record)]
    spectrum = np.abs(np.fft.rfft((u - u.mean()) * np.hanning(u.size)))
    resolution = 1.0 / (u.size * record.sample_period)
    return float(spectrum[1:].argmax() + 1) * resolution if spectrum.size > 1 else 0.0, resolution


def _correlation(voltage: Samples, displacement: Samples) -> float:
    u, y = voltage - voltage.mean(), displacement - displacement.mean()
    return float(u @ y) / max(float(np.sqrt((u @ u) * (y @ y))), 1e-300)


def _polarity(moving: list[Record], unit: str | float | None) -> list[Notice]:
    """Notice where the displacement falls when the voltage rises, in the record with the slowest drive.

    A loop of this sign is described badly, so the notice says how the sensor is reversed on reading.
    """
    slowest = min(moving, key=lambda r: _fundamental(r)[0], default=None)
    if slowest is None or slowest.size < 64:
        return []
    part = _excerpt(slowest)
    window = np.hanning(slowest.voltage[part].size)
    u, y = (np.fft.rfft((x[part] - x[part].mean()) * window) for x in (slowest.voltage, slowest.displacement))
    at = int(np.abs(u[1:]).argmax()) + 1
    if at < 4 or np.abs(u[at]) ** 2 < 0.2 * float(np.sum(np.abs(u[1:]) ** 2)):
        # too short for an estimate of the period: the channels must be nearly proportional
        if _correlation(slowest.voltage[part], slowest.displacement[part]) > _REVERSED:
            return []
    elif float(np.real(y[at] * np.conj(u[at]))) >= 0.0:
        return []
    given = "" if unit is None else f"{unit}"
    turned = "a unit without the minus" if given.startswith(REVERSED) else f"`units` displacement={REVERSED}{given}"
    message = f"the displacement falls when the voltage rises; if the sensor is reversed, give {turned}"
    return [Notice("polarity", message, slowest.phase)]
