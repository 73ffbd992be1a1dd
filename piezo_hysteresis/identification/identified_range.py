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

"""Voltages, frequencies and rates of the data of a model, kept in its provenance, and drives outside this range."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ..effects import Arx, UnnamedCorrection
from ..effects.effect import Discretisation
from ..model.model import Model
from ..parameter import slew_text
from ..record import Experiment, Notice, Record
from .records.excitation_content import MOVES, ExcitationContent, excitation_content, moving
from .records.noise import voltage_noise
from .records.steady_waves import rates_of_waves
from .steps.remaining_lag import error_of_lag
from .structure.pieces import Kind, pieces_of

LOWEST, HIGHEST = "voltage_min", "voltage_max"
"""Keys of the provenance: voltages [V]."""
SLOWEST, FASTEST = "frequency_min", "frequency_max"
"""Keys of the provenance: slowest and fastest rate of the drive between its steps [Hz]."""
STEEPEST = "slew_rate_max"
"""Key of the provenance: rate that is exceeded in 1 % of the moving samples [V/s]."""
STEEPEST_STEP = "step_rate_max"
"""Key of the provenance: largest rate between two samples, also that of a step [V/s]."""
LAG_ERROR = "lag_uncertainty"
"""Key of the provenance: half of the 95 % interval of the lag [s]; absent if broadband records show the dynamics."""
KEYS = (LOWEST, HIGHEST, SLOWEST, FASTEST, STEEPEST)
"""The range."""
BEYOND, FASTER, SLOWER = 0.02, 1.5, 3.0
"""Share of the voltage range, and factors of frequency and rate, from which a drive is outside.

The influence of a lag or a mode grows with the frequency, that of creep with its logarithm.
"""
ABOVE = 4.0
"""Standard deviations of the noise of a measured voltage that count for no motion between two samples."""
COARSE = 0.02
"""RMS error from the dynamics at slow samples, as a share of the range of the drive, from which it is reported."""
STEEP = 0.99
"""Share of the moving samples whose rate is at most the rate of a record."""


def identified_range(records: Sequence[Record], fitted: Collection[int]) -> Mapping[str, str]:
    """Voltages, frequencies and rates of the records that were fitted.

    Parameters
    ----------
    records : sequence of Record
        Records in order.
    fitted : collection of int
        Indices of the fitted records.
    """
    before = _voltages_before(records)
    chosen = [records[i] for i in fitted]
    voltages = np.concatenate([np.append(r.voltage, r.settled_voltage) for r in chosen])
    moved = moving([_motion(r) for r in chosen])
    found = {
        LOWEST: voltages.min(),
        HIGHEST: voltages.max(),
        SLOWEST: min((m.slowest for m in moved if m.bandwidth > 0.0), default=0.0),
        FASTEST: max((m.highest for m in moved), default=0.0),
        STEEPEST: max(_slew_rate(r) for r in chosen),
        STEEPEST_STEP: max(_largest_step(records[i], before[i]) / records[i].sample_period for i in fitted),
    }
    return {key: repr(float(f"{number:.6g}")) for key, number in found.items()}


def outside(model: Model, experiment: Experiment) -> tuple[Notice, ...]:
    """Notices about records whose drive is larger, faster or slower than the data of the identification.

    Parameters
    ----------
    model : Model
        Model with its range in the provenance; without a range there are no notices.
    experiment : Experiment
        Experiment that is compared with the model.
    """
    pairs = zip(experiment, _voltages_before(experiment.records), strict=True)
    return tuple(notice for record, before in pairs for notice in outside_of(model, record, before))


def outside_of(model: Model, record: Record, before: float | None = None) -> Iterator[Notice]:
    """`outside` of one record, or of a window of samples, including where a correction without a name is not valid.

    `before` is the voltage before the first sample [V], by default the settled one.
    """
    is_corrected = any(isinstance(e, UnnamedCorrection) for e in model.effects)
    for notice in _outside_of(model, record, record.settled_voltage if before is None else before):
        more = f"{notice.message}; its correction without a name is not valid there"
        yield replace(notice, message=more) if is_corrected else notice


def _outside_of(model: Model, record: Record, before: float) -> Iterator[Notice]:
    if not set(KEYS) <= set(model.provenance):
        return
    low, high, slowest, fastest, steepest = (float(model.provenance[key]) for key in KEYS)
    room = BEYOND * (high - low)
    least, most = float(record.voltage.min()), float(record.voltage.max())
    motion = _motion(record)
    if least < low - room or most > high + room:
        known = f"the model was identified from {low:.3g} to {high:.3g} V"
        said = f"the drive goes from {least:.3g} to {most:.3g} V, {known}"
        yield Notice("outside_amplitudes", said, record.phase)
    drive_moves = motion.span >= MOVES * (high - low)
    if drive_moves and motion.highest > FASTER * fastest > 0.0:
        said = f"the drive reaches {motion.highest:.3g} Hz, the model was identified up to {fastest:.3g} Hz"
        yield Notice("outside_frequencies", said + _lag_error(model, motion.highest), record.phase)
    if drive_moves and SLOWER * motion.slowest < slowest and motion.bandwidth > 0.0:
        said = f"the drive is as slow as {motion.slowest:.3g} Hz, the model was identified from {slowest:.3g} Hz"
        yield Notice("outside_frequencies", said, record.phase)
    if drive_moves and (error := _error_of_slow_samples(model, record)) > COARSE:
        said = (
            f"at {record.sample_period:g} s per sample the dynamics of the model are a gain and a lag, which for this"
        )
        said += f" drive can be wrong by {100.0 * error:.2g} % of its range; record it at {model.sample_period:g} s"
        yield Notice("outside_frequencies", said, record.phase)
    rate, step = _slew_rate(record), _largest_step(record, before)
    sudden, steepest_step = step / record.sample_period, float(model.provenance.get(STEEPEST_STEP, np.inf))
    is_known_step = motion.is_step and sudden <= FASTER * steepest_step < np.inf
    if rate > FASTER * steepest > 0.0 and not is_known_step:
        said = f"the drive changes by {slew_text(rate, 4)}, the model was identified up to {slew_text(steepest, 4)}"
        yield Notice("outside_rates", said, record.phase)
    if step >= MOVES * (high - low) and sudden > FASTER * max(steepest_step, rate):
        said = f"the drive steps by {step:.3g} V in one sample ({slew_text(sudden, 4)})"
        said += f", the model was identified up to {slew_text(steepest_step, 4)}"
        yield Notice("outside_rates", said, record.phase)


def _motion(record: Record) -> ExcitationContent:
    """Content of the drive of a record between its steps and holds; of a drive that only steps, that of the steps.

    A step has most of the power of dv/dt, at all frequencies, and would hide the rate of a sine after it. So would a
    fast sine hide a slow one.
    """
    pieces = pieces_of((record,), (0,))
    moves = np.repeat([p.kind is Kind.LOOP for p in pieces], [p.record.size for p in pieces])
    voltage = np.cumsum(np.diff(record.voltage, prepend=record.voltage[0])[moves])
    if not np.ptp(voltage) > 0.0:
        return excitation_content(record)
    content = excitation_content(Record(voltage, voltage, record.sample_period, continues=True))
    if not content.waves:
        return content
    slowest, _ = rates_of_waves(voltage, record.sample_period, float(voltage_noise((record,))[0]))
    return replace(content, slowest=slowest)


def _error_of_slow_samples(model: Model, record: Record) -> float:
    """RMS error of dc gain and group delay in the place of G, as a share of the range; 0 at the model's period."""
    dynamics = next((e for e in model.effects if isinstance(e, Arx)), None)
    if dynamics is None or not Discretisation(record.sample_period, model.sample_period).is_slow:
        return 0.0
    frequency = np.asarray(np.fft.rfftfreq(record.size, record.sample_period), np.float64)
    power = np.abs(np.fft.rfft((record.voltage - record.voltage.mean()) * np.hanning(record.size + 2)[1:-1])) ** 2
    lag = max(dynamics.group_delay, 0.0) * model.sample_period
    response = dynamics.response(frequency, model.sample_period) / dynamics.dc_gain
    wrong = np.abs(response - np.exp(-2j * np.pi * frequency * lag)) ** 2
    share = np.std(record.voltage) / np.ptp(record.voltage)
    return float(share * np.sqrt(power @ wrong / power.sum()))


def _lag_error(model: Model, frequency: float) -> str:
    """What the uncertainty of the lag means at a frequency, as the end of a sentence."""
    if LAG_ERROR not in model.provenance:
        return ""
    late = float(model.provenance[LAG_ERROR])
    share = 100.0 * error_of_lag(late, frequency)
    return f"; its lag is known within {1e3 * late:.2g} ms, which alone allows an error of {share:.2g} % of the range"


def _slew_rate(record: Record) -> float:
    steps = np.abs(np.diff(record.voltage)) - ABOVE * voltage_noise((record,))[0]
    moving = steps[steps > 0.0]
    return float(np.quantile(moving, STEEP)) / record.sample_period if moving.size else 0.0


def _largest_step(record: Record, before: float) -> float:
    """Largest change between two samples, and from the voltage before to the first one [V]."""
    noise = ABOVE * float(voltage_noise((record,))[0])
    return max(0.0, float(np.abs(np.diff(record.voltage, prepend=before)).max()) - noise)


def _voltages_before(records: Sequence[Record]) -> list[float]:
    """Voltage before the first sample of every record [V]."""
    found = [records[0].settled_voltage]
    for before, record in pairwise(records):
        gap = record.start_time - before.start_time - before.duration
        if not record.continues:
            found.append(record.settled_voltage)
        elif record.truncated or gap > 1.5 * before.sample_period:  # the drive has moved in samples that are lost
            found.append(float(record.voltage[0]))
        else:
            found.append(float(before.voltage[-1]))
    return found
