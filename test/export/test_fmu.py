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

"""Exported co-simulation units, in the hands of FMPy: valid, and equal to the model."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest

from piezo_hysteresis.compensation import Inverse, Limits
from piezo_hysteresis.effects import Arx, BoucWen, Creep, Offset, ThermalExpansion
from piezo_hysteresis.errors import ModelError
from piezo_hysteresis.export import fmus
from piezo_hysteresis.model.model import Model

from ..contract.compiled import needs_compiler

fmpy = pytest.importorskip("fmpy", reason="no FMPy here; scripts/setup-checks installs it")
validation = pytest.importorskip("fmpy.validation")
fmi3 = pytest.importorskip("fmpy.fmi3")
FMI_ERROR = pytest.importorskip("fmpy.fmi1").FMICallException

PERIOD = 1e-4
MODEL = Model(
    (BoucWen(), Creep(gamma=0.012), Arx(a=[-1.2, 0.6], b=[0.3, 0.1], delay=2), Offset(y0=2e-7)), PERIOD, 10.0, 1e-5
)
WORST = 1e-12
"""Largest deviation, as a share of the largest output."""


def drive(n: int = 600) -> np.ndarray:
    rng = np.random.default_rng(5)
    return 4.0 + 2.0 * np.sin(np.arange(n) / 30.0) + rng.normal(scale=0.1, size=n)


def saved(files, folder: Path) -> dict[str, str]:
    for name, content in files.items():
        (folder / name).write_bytes(content)
    return {name: str(folder / name) for name in files}


def simulated(unit: str, output: str, initial: float, rows: dict[str, np.ndarray], hold: int = 1) -> np.ndarray:
    """Output after every communication step of `hold` samples, the value at rest before."""
    n = len(next(iter(rows.values())))
    times = hold * PERIOD * np.arange(n)
    signals = np.array(list(zip(times, *rows.values(), strict=True)), dtype=[(k, float) for k in ("time", *rows)])
    result = fmpy.simulate_fmu(
        unit, start_time=0.0, stop_time=n * hold * PERIOD, output_interval=hold * PERIOD, input=signals,
        start_values={"initial_voltage": initial}, output=[output],
    )  # fmt: skip
    return result[output]


@needs_compiler
def test_the_prediction_is_valid_and_equals_the_model(tmp_path):
    unit = saved(fmus(MODEL, "stage_x"), tmp_path)["stage_x.fmu"]
    assert validation.validate_fmu(unit) == []
    u = drive()
    expected, _ = MODEL.run(u, MODEL.rest(u[0]))
    y = simulated(unit, "displacement", float(u[0]), {"voltage": u})
    assert y.size == u.size + 1
    assert np.abs(y[1:] - expected).max() <= WORST * np.abs(expected).max()
    assert y[0] == pytest.approx(MODEL.run([u[0]], MODEL.rest(u[0]))[0][0], rel=1e-12)


@needs_compiler
def test_inputs_are_constant_during_a_longer_communication_step(tmp_path):
    unit = saved(fmus(MODEL), tmp_path)["piezo.fmu"]
    u = drive(60)
    expected, _ = MODEL.run(np.repeat(u, 5), MODEL.rest(u[0]))
    y = simulated(unit, "displacement", float(u[0]), {"voltage": u}, hold=5)
    assert np.abs(y[1:] - expected[4::5]).max() <= WORST * np.abs(expected).max()


@needs_compiler
def test_the_inverse_is_valid_and_equals_that_of_the_model(tmp_path):
    inverse = Inverse(MODEL, Limits(0.0, 10.0))
    units = saved(fmus(MODEL, "piezo", inverse), tmp_path)
    assert set(units) == {"piezo.fmu", "piezo_inverse.fmu"}
    assert validation.validate_fmu(units["piezo_inverse.fmu"]) == []
    path, _ = MODEL.run(drive(), MODEL.rest(4.0))
    expected, _ = inverse.run(path, inverse.rest(4.0))
    u = simulated(units["piezo_inverse.fmu"], "voltage", 4.0, {"displacement": path})
    assert u[0] == 4.0
    assert np.abs(u[1:] - expected).max() <= WORST * max(1.0, inverse.noise_gain) * np.abs(expected).max()


@needs_compiler
def test_measured_channels_are_further_inputs(tmp_path):
    model = MODEL.with_effect(ThermalExpansion(kappa=1e-7))
    unit = saved(fmus(model), tmp_path)["piezo.fmu"]
    assert validation.validate_fmu(unit) == []
    u, temperature = drive(), 293.15 + np.linspace(0.0, 3.0, 600)
    expected, _ = model.run(u, model.rest(u[0]), {"temperature": temperature})
    y = simulated(unit, "displacement", float(u[0]), {"voltage": u, "temperature": temperature})
    assert np.abs(y[1:] - expected).max() <= WORST * np.abs(expected).max()


@pytest.fixture
def instance(tmp_path):
    """The prediction, initialised at 4 V."""
    unit = saved(fmus(MODEL), tmp_path)["piezo.fmu"]
    description, folder = fmpy.read_model_description(unit), fmpy.extract(unit, str(tmp_path / "unit"))
    made = fmi3.FMU3Slave(
        guid=description.instantiationToken, unzipDirectory=folder, modelIdentifier="piezo", instanceName="one"
    )
    made.instantiate(logMessage=lambda *_: None)
    made.setFloat64([1], [4.0])
    made.enterInitializationMode(startTime=0.0)
    made.exitInitializationMode()
    yield made
    made.terminate()
    made.freeInstance()


def played(instance, u) -> list[float]:
    out = []
    for k, voltage in enumerate(u):
        instance.setFloat64([3], [voltage])
        instance.doStep(k * PERIOD, PERIOD)
        out += instance.getFloat64([2])
    return out


@needs_compiler
def test_a_saved_state_is_taken_up_again_bit_for_bit(instance):
    u = drive(80)
    played(instance, u[:40])
    state = instance.getFMUState()
    kept = instance.serializeFMUState(state)
    first = played(instance, u[40:])
    instance.setFMUState(state)
    assert played(instance, u[40:]) == first
    instance.setFMUState(instance.deserializeFMUState(kept))
    assert played(instance, u[40:]) == first
    instance.freeFMUState(state)


@needs_compiler
def test_invalid_values_are_refused(instance):
    for step in (0.5 * PERIOD, 1.5 * PERIOD, 0.0, -PERIOD):
        with pytest.raises(FMI_ERROR):
            instance.doStep(0.0, step)
    for reference, value in ((3, np.nan), (1, 2.0), (2, 1e-6), (0, 1.0), (4, 1.0)):
        with pytest.raises(FMI_ERROR):
            instance.setFloat64([reference], [value])
    with pytest.raises(FMI_ERROR):
        instance.getInt32([2])


def test_the_name_of_a_source_file_of_every_unit_is_refused():
    """The interface replaced the model, and the unit could not be loaded."""
    with pytest.raises(ModelError, match="name: got 'fmi3'"):
        fmus(Model((BoucWen(),), 1e-3), "fmi3")


def test_without_a_compiler_the_unit_contains_only_sources(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    unit = saved(fmus(MODEL), tmp_path)["piezo.fmu"]
    with zipfile.ZipFile(unit) as archive:
        names = archive.namelist()
        build = archive.read("sources/buildDescription.xml").decode()
    assert not any(name.startswith("binaries") for name in names)
    assert all(f"sources/{name}" in names for name in ("fmi3.c", "piezo.c", "piezo.h"))
    assert 'name="fmi3.c"' in build and 'name="piezo.c"' in build
    assert validation.validate_fmu(unit) == []


@needs_compiler
def test_the_same_model_gives_the_same_bytes():
    assert fmus(MODEL) == fmus(MODEL)
