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

"""Identification compared with SysIdentPy, which fits polynomial NARX models; skipped if it is not installed.

Both get the records of one experiment, in volts and normalised displacement, and predict its validation record in free
run. Theirs is a NARX polynomial of second degree with lags around the dead time, 12 or 20 terms chosen by FROLS and the
error reduction ratio: the structure is given, the numbers are fitted once. That is the work of our three steps, with
which the ratio is taken; `identify` compares orders and fits everything jointly besides.

    pip install sysidentpy==0.9.0
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np

from benchmarks import published_plant as plant
from benchmarks import recovery
from benchmarks.figures import Cell, Figures
from piezo_hysteresis.effects import PublishedBoucWen
from piezo_hysteresis.identification import identify, three_steps
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Experiment, Record

INPUT_LAGS, OUTPUT_LAGS = [2, 3, 4, 5, 6], [1, 2, 3]
TERMS = (12, 20)


def against_sysidentpy(data: Experiment) -> Figures | None:
    """Processor time and free-run error of both, None without the package."""
    try:
        import sysidentpy
    except ImportError:
        return None
    fitted, held_out = [r for r in data.records if r.phase != "validation"], data.records[-1]
    size = sum(r.size for r in fitted)
    gain = float(plant.B_Z.sum() / plant.A_Z.sum())
    scales = {"voltage_scale": 10.0, "displacement_scale": recovery.METRE}
    rows: list[tuple[Cell, ...]] = []

    def own(name: str, identified: Callable[[], Model]) -> float:
        begin = time.process_time()
        model = identified()
        spent = time.process_time() - begin
        error = _percent(held_out.displacement - model.simulate(held_out)[0], held_out)
        rows.append((name, spent, size / spent / 1e6, error))
        return spent

    hysteresis = PublishedBoucWen
    own("identify, complete", lambda: identify(data, gain=gain, hysteresis=hysteresis, **scales).model)
    steps = own("three steps as published", lambda: three_steps(data.records, hysteresis=hysteresis, **scales).model)
    theirs = []
    for terms in TERMS:
        spent, error = _narx(fitted, held_out, terms)
        theirs.append(spent)
        rows.append((f"SysIdentPy, FROLS, {terms} terms", spent, size / spent / 1e6, error))
    rows.append((f"ratio to the three steps, {TERMS[0]} terms", theirs[0] / steps, None, None))
    columns = ("what", "processor s", "M samples/s", "free run, held out, % of range")
    return Figures(f"Compared with SysIdentPy {sysidentpy.__version__}, {size:.1e} samples", columns, rows)


def _narx(fitted: Sequence[Record], held_out: Record, terms: int) -> tuple[float, float]:
    """Processor time [s] of their fit, and the error of its free run [% of range]."""
    from sysidentpy.basis_function import Polynomial
    from sysidentpy.model_structure_selection import FROLS
    from sysidentpy.parameter_estimation import LeastSquares

    model = FROLS(
        order_selection=False,
        n_terms=terms,
        xlag=INPUT_LAGS,
        ylag=OUTPUT_LAGS,
        basis_function=Polynomial(degree=2),
        estimator=LeastSquares(),
    )
    u, y = (np.concatenate(parts)[:, None] for parts in zip(*(_normalised(r) for r in fitted), strict=True))
    begin = time.process_time()
    model.fit(X=u, y=y)
    spent = time.process_time() - begin
    u, y = (column[:, None] for column in _normalised(held_out))
    lags = max(*INPUT_LAGS, *OUTPUT_LAGS)
    error = recovery.METRE * (y - model.predict(X=u, y=y[:lags]))[lags:, 0]
    return spent, _percent(error, held_out)


def _normalised(record: Record) -> tuple[np.ndarray, np.ndarray]:
    return record.voltage / 10.0, record.displacement / recovery.METRE


def _percent(error: np.ndarray, record: Record) -> float:
    return 100.0 * float(np.std(error) / np.ptp(record.displacement))
