"""Identification beside SysIdentPy, which fits polynomial NARX models; left out where the package is not installed.

Both get the records of one experiment, in volts and normalised displacement, and predict its validation record in free
run. Theirs is a NARX polynomial of second degree with lags around the dead time, terms chosen by FROLS and the error
reduction ratio.

    pip install sysidentpy==0.9.0
"""

from __future__ import annotations

import time

import numpy as np

from benchmarks import published_plant as plant
from benchmarks import recovery
from benchmarks.figures import Figures
from piezo_hysteresis.effects import PublishedBoucWen
from piezo_hysteresis.identification import identify
from piezo_hysteresis.record import Experiment, Record

INPUT_LAGS, OUTPUT_LAGS = [2, 3, 4, 5, 6], [1, 2, 3]
TERMS = 12


def against_sysidentpy(data: Experiment) -> Figures | None:
    """Processor time and free-run error of both, None without the package."""
    try:
        from sysidentpy.basis_function import Polynomial
        from sysidentpy.model_structure_selection import FROLS
        from sysidentpy.parameter_estimation import LeastSquares
    except ImportError:
        return None
    fitted, held_out = [r for r in data.records if r.phase != "validation"], data.records[-1]
    size = sum(r.size for r in fitted)
    gain = float(plant.B_Z.sum() / plant.A_Z.sum())
    begin = time.process_time()
    own = identify(
        data, gain=gain, voltage_scale=10.0, displacement_scale=recovery.METRE, hysteresis=PublishedBoucWen
    ).model
    own_time = time.process_time() - begin
    theirs = FROLS(
        order_selection=False,
        n_terms=TERMS,
        xlag=INPUT_LAGS,
        ylag=OUTPUT_LAGS,
        basis_function=Polynomial(degree=2),
        estimator=LeastSquares(),
    )
    u, y = (np.concatenate(parts)[:, None] for parts in zip(*(_normalised(r) for r in fitted), strict=True))
    begin = time.process_time()
    theirs.fit(X=u, y=y)
    their_time = time.process_time() - begin
    u, y = (column[:, None] for column in _normalised(held_out))
    lags = max(*INPUT_LAGS, *OUTPUT_LAGS)
    their_error = recovery.METRE * (y - theirs.predict(X=u, y=y[:lags]))[lags:, 0]
    own_error = held_out.displacement - own.simulate(held_out)[0]
    rows = [
        ("identify, the whole of it", own_time, size / own_time / 1e6, _percent(own_error, held_out)),
        ("SysIdentPy, FROLS", their_time, size / their_time / 1e6, _percent(their_error, held_out)),
        ("ratio", their_time / own_time, None, None),
    ]
    columns = ("what", "processor s", "M samples/s", "free run, held out, % of range")
    return Figures(f"Beside another package, {size:.1e} samples", columns, rows)


def _normalised(record: Record) -> tuple[np.ndarray, np.ndarray]:
    return record.voltage / 10.0, record.displacement / recovery.METRE


def _percent(error: np.ndarray, record: Record) -> float:
    return 100.0 * float(np.std(error) / np.ptp(record.displacement))
