"""Voltages and fastest drive that a model was identified on, in its provenance, and what lies outside of them."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from ..model.model import Model
from ..record import Experiment, Notice, Record
from .records.excitation_content import excitation_content

LOWEST, HIGHEST, FASTEST = "voltage_min", "voltage_max", "frequency_max"
"""Keys of the provenance: voltages [V], and frequency below which 95 % of the power of dv/dt lies [Hz]."""
BEYOND, FASTER = 0.02, 1.5
"""Share of the range of the voltage, and factor of the frequency, from which a drive is outside."""


def identified_range(records: Sequence[Record], fitted: Collection[int]) -> Mapping[str, str]:
    """Voltages and fastest drive of the records that were fitted.

    Parameters
    ----------
    records : sequence of Record
        In order.
    fitted : collection of int
        Indices of those that were fitted.
    """
    chosen = [records[i] for i in fitted]
    voltages = np.concatenate([np.append(r.voltage, r.settled_voltage) for r in chosen])
    found = {
        LOWEST: voltages.min(),
        HIGHEST: voltages.max(),
        FASTEST: max(excitation_content(r).bandwidth for r in chosen),
    }
    return {key: repr(float(f"{number:.6g}")) for key, number in found.items()}


def outside(model: Model, experiment: Experiment) -> tuple[Notice, ...]:
    """One notice for every record that drives the stage farther or faster than the model was identified.

    Parameters
    ----------
    model : Model
        With its range in its provenance; without it nothing is noticed.
    experiment : Experiment
        What it is compared with.
    """
    if not {LOWEST, HIGHEST, FASTEST} <= set(model.provenance):
        return ()
    low, high, fastest = (float(model.provenance[key]) for key in (LOWEST, HIGHEST, FASTEST))
    room = BEYOND * (high - low)
    notices = []
    for record in experiment:
        least, most = float(record.voltage.min()), float(record.voltage.max())
        rate = excitation_content(record).bandwidth
        if least < low - room or most > high + room:
            known = f"the model was identified from {low:.3g} to {high:.3g} V"
            said = f"the drive goes from {least:.3g} to {most:.3g} V, {known}"
            notices.append(Notice("outside_amplitudes", said, record.phase))
        if rate > FASTER * fastest > 0.0:
            said = f"the drive reaches {rate:.3g} Hz, the model was identified up to {fastest:.3g} Hz"
            notices.append(Notice("outside_frequencies", said, record.phase))
    return tuple(notices)
