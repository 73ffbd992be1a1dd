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

"""A measured piezo: free-run error of several models, on the recording to which they were fitted and on another one.

Rows 0 to 7000 of the Model record of picma-p885 fit and choose everything; the whole Test record is predicted from
0 V. One constant is free per record, nothing else. Errors are RMS in % of the range of the record.

    python -m benchmarks.real_recordings --data ../shared/data

What was promised, in %: the model of `piezo identify` at most 0.5 on Test and 0.25 behind row 1000 of Model,
with drift too. Without the data nothing is judged.
"""

from __future__ import annotations

import argparse
import os
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from benchmarks.figures import Cell, Figures, alone
from piezo_hysteresis import recording
from piezo_hysteresis.discrepancy import diagnose
from piezo_hysteresis.effects import CATALOGUE, ThermalDrift
from piezo_hysteresis.identification.fit.fit import fit
from piezo_hysteresis.identification.fit.normal_equations import Nuisance
from piezo_hysteresis.identification.identify import identify
from piezo_hysteresis.identification.records.noise_floor import drive_period
from piezo_hysteresis.identification.steps.dynamics import identify_arx
from piezo_hysteresis.identification.steps.three_steps import voltage_signals
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Experiment, Record

ROWS = (0, 7000)
SETTLED = 1000
"""First row of the part that shows hysteresis alone."""
PARTS = ("Model 0-7000", "Model 1000-7000", "Test")
IDENTIFIED, WITH_DRIFT = "plays, cubic and lag (identify)", "plays, lag, drift"
PROMISED = {IDENTIFIED: (0.25, 0.5), WITH_DRIFT: (0.25, 0.5)}
"""Model to the largest error behind row `SETTLED` of Model, and on Test."""
Prediction = Callable[[Record], np.ndarray]


def read(folder: Path, name: str, rows: tuple[int, int] | None = None) -> Record:
    """One of the records, in SI units, the stage settled at 0 V before it."""
    return recording.read(
        folder / "picma-p885" / name,
        columns={"voltage": 1, "displacement": 5},
        units={"displacement": "um"},
        sample_period=5e-3,
        initial_voltage=0.0,
        rows=rows,
        phases="record",
    )[0]


def percent(record: Record, prediction: Prediction) -> tuple[float, float]:
    """Error over the whole record and behind row `SETTLED`, one constant for the record."""
    left = record.displacement - prediction(record)
    left -= left.mean()
    span = np.ptp(record.displacement)
    return tuple(float(100.0 * np.sqrt(np.mean(part**2)) / span) for part in (left, left[SETTLED:]))


def free_run(model: Model) -> Prediction:
    """A model as a prediction."""
    return lambda record: model.simulate(record)[0]


def static_cubic(record: Record) -> Prediction:
    """y a cubic of the drive, without memory."""
    cubic = np.polynomial.Polynomial.fit(record.voltage, record.displacement, 3)
    return lambda other: cubic(other.voltage)


def linear_arx(record: Record) -> Prediction:
    """The best of some orders and delays by free run on the record, linear from drive to displacement."""
    signals = voltage_signals([record], 3.6, 1e-6)
    found = []
    for order in (1, 2, 4, 8):
        for delay in (1, 2):
            arx = identify_arx(signals, delay, record.sample_period, (order, order)).arx
            if arx.pole_radius < 1.0:
                found.append(free_run(Model((arx,), record.sample_period, 3.6, 1e-6)))
    return min(found, key=lambda prediction: percent(record, prediction)[0])


def classical(modified: Model, record: Record) -> Prediction:
    """Bouc-Wen without the cubic term, with the same lag."""
    start = modified.with_values({"bouc_wen.p1": 0.0})
    free = [*(f"bouc_wen.{n}" for n in ("A", "beta", "gamma", "p2")), "arx.a[0]", "arx.b[0]", "arx.delay"]
    return free_run(fit(start, [record], free, nuisance=Nuisance(offset=True)).model)


def sysidentpy(record: Record) -> Prediction | None:
    """Polynomial NARX by forward regression; degree and lags by free run on the last quarter. None where missing."""
    try:
        from sysidentpy.basis_function import Polynomial
        from sysidentpy.model_structure_selection import FROLS
        from sysidentpy.parameter_estimation import LeastSquares
    except ImportError:
        return None
    low, span = record.displacement.min(), np.ptp(record.displacement)

    def columns(other: Record) -> tuple[np.ndarray, np.ndarray]:
        return other.voltage[:, None] / 3.6, ((other.displacement - low) / span)[:, None]

    def train(part: Record, degree: int, lags: int) -> Prediction:
        network = FROLS(
            order_selection=True,
            n_info_values=20,
            ylag=lags,
            xlag=lags,
            info_criteria="bic",
            estimator=LeastSquares(),
            basis_function=Polynomial(degree=degree),
        )
        u, y = columns(part)
        network.fit(X=u, y=y)

        def predict(other: Record) -> np.ndarray:
            drive, start = columns(other)
            # the recording begins with 0 V: its settled samples are the initial condition
            rest = np.full((lags, 1), start[0, 0])
            y = network.predict(X=np.vstack((np.full((lags, 1), other.settled_voltage), drive)), y=rest)
            return low + span * y[lags:, 0]

        return predict

    cut = 3 * record.size // 4
    tried = []
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        for degree in (1, 2, 3):
            for lags in (2, 4):
                left = record.displacement - train(record[:cut], degree, lags)(record)
                if np.isfinite(left).all():
                    tried.append((float(np.std(left[cut:])), degree, lags))
        return train(record, *min(tried)[1:])


def predictions(record: Record) -> Iterator[tuple[str, Prediction | None]]:
    """Every model, fitted to the record."""
    whole = Experiment((record,))
    modified = identify(whole).model
    yield "static cubic", static_cubic(record)
    yield "linear ARX", linear_arx(record)
    yield "SysIdentPy, polynomial NARX", sysidentpy(record)
    yield "classical Bouc-Wen and lag", classical(modified, record)
    yield "modified Bouc-Wen and lag (identify --no-memory)", free_run(modified)
    yield IDENTIFIED, free_run(identify(whole, memory=True).model)
    for name, effects in ((WITH_DRIFT, (ThermalDrift,)), ("the model of diagnose", CATALOGUE)):
        found = diagnose(whole, effects=effects)
        assert found.model is not None and found.selection is not None
        names = " + ".join(step.best.effect.public_name() for step in found.selection.accepted)
        yield f"{name}: {names}", free_run(found.model)


def repeatability(record: Record) -> float:
    """Deviation of the cycles from their mean cycle [%], the first 5 left out."""
    period = drive_period(record.voltage[SETTLED:]) or 200
    cycles = record.displacement[SETTLED:][: (record.size - SETTLED) // period * period].reshape(-1, period)
    return float(100.0 * np.std(cycles - cycles.mean(axis=0)) / np.ptp(record.displacement))


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--data", default=os.environ.get("PIEZO_DATA", "../shared/data"), help="holds picma-p885")


def run(options: argparse.Namespace) -> list[Figures]:
    """One row per model."""
    folder = Path(options.data).expanduser()
    if not (folder / "picma-p885").is_dir():
        return [Figures("Free-run error", ("model",), [(f"not measured: no picma-p885 in {folder}; set PIEZO_DATA",)])]
    record, other = read(folder, "Model_Vi_Do.dat", ROWS), read(folder, "Test_Vi_Do_Di.dat")
    rows: list[tuple[Cell, ...]] = []
    failures = []
    for name, prediction in predictions(record):
        if prediction is None:
            rows.append((f"{name}: not installed", None, None, None))
            continue
        (fitted, settled), (test, _) = percent(record, prediction), percent(other, prediction)
        rows.append((name, fitted, settled, test))
        limits = PROMISED.get(name.split(":")[0], (np.inf, np.inf))
        for part, error, promised in zip(PARTS[1:], (settled, test), limits, strict=True):
            if error > promised:
                failures.append(f"{name}, {part}: {error:.3f}, promised {promised}")
    rows.append(("cycles about their mean", None, repeatability(record), None))
    return [Figures("Free-run error, % of range", ("model", *PARTS), rows, tuple(failures))]


if __name__ == "__main__":
    alone(__name__)
