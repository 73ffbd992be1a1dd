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

"""Promises of the plant as a whole: reproducible, independent of blocks, limits, parameters from and to a mapping."""

import importlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from piezo_hysteresis.errors import ParameterError
from piezo_hysteresis.stage.hidden import HIDDEN_EFFECTS, hidden_effect
from piezo_hysteresis.stage.plant import Plant, PlantParameters

TS = 20e-6


def everything():
    """A stage with every effect of the catalogue at once."""
    parameters = PlantParameters.from_mapping({"sensor.flicker": 1e-4, "environment.thermometer": 1})
    for name in HIDDEN_EFFECTS:
        parameters = hidden_effect(7, parameters, name=name).parameters
    return parameters


EVERYTHING = everything()
DRIVE = np.random.default_rng(0).uniform(0.0, 10.0, 600).repeat(3)
WHOLE = Plant(EVERYTHING, TS, seed=4).run(DRIVE)


@settings(max_examples=20)
@given(st.lists(st.integers(1, DRIVE.size - 1), max_size=6))
def test_cutting_the_drive_into_blocks_changes_no_bit(cuts):
    plant = Plant(EVERYTHING, TS, seed=4)
    blocks = [plant.run(part) for part in np.split(DRIVE, sorted(set(cuts)))]
    for name in ("voltage", "displacement"):
        np.testing.assert_array_equal(np.concatenate([getattr(b, name) for b in blocks]), getattr(WHOLE, name))
    assert set(WHOLE.channels) == {"other_displacement", "temperature"}
    for name, whole in WHOLE.channels.items():
        np.testing.assert_array_equal(np.concatenate([b.channels[name] for b in blocks]), whole)


def test_the_same_seed_is_the_same_experiment_and_another_is_not():
    np.testing.assert_array_equal(Plant(EVERYTHING, TS, seed=4).run(DRIVE).displacement, WHOLE.displacement)
    other = Plant(EVERYTHING, TS, seed=5).run(DRIVE)
    assert np.any(other.displacement != WHOLE.displacement)
    assert np.any(other.channels["other_displacement"] != WHOLE.channels["other_displacement"])
    np.testing.assert_array_equal(other.voltage, WHOLE.voltage)


def test_compiled_kernels_equal_the_same_loops_in_plain_python(monkeypatch):
    """What a user without numba gets."""
    for name in ("electronics", "hysteresis", "creep", "structure", "environment", "sensor"):
        module = importlib.import_module(f"piezo_hysteresis.stage.plant.{name}")
        for function, loop in list(vars(module).items()):
            if hasattr(loop, "py_func"):
                monkeypatch.setattr(module, function, loop.py_func)
    plain = Plant(EVERYTHING, TS, seed=4).run(DRIVE[:60])
    np.testing.assert_allclose(plain.displacement, WHOLE.displacement[:60], rtol=1e-12)


def test_everything_at_once_stays_finite_and_within_the_sensor():
    assert np.isfinite(WHOLE.displacement).all()
    assert np.abs(WHOLE.displacement).max() <= EVERYTHING.sensor.range
    assert WHOLE.voltage.min() >= 0.0
    assert WHOLE.voltage.max() <= 10.0


def test_time_continues_through_a_change_of_sample_period():
    plant = Plant(PlantParameters(), TS)
    plant.run(np.full(1000, 2.0))
    plant.configure(1e-3, plant.voltage)
    plant.run(np.full(30, 2.0))
    assert plant.time == pytest.approx(0.02 + 0.03)


@pytest.mark.parametrize("name", HIDDEN_EFFECTS)
def test_every_hidden_effect_is_off_by_default_and_changes_the_stage(name):
    """Bipolar, fast, slow and large at once, so that nothing can hide."""
    base = PlantParameters.from_mapping({"electronics.voltage_min": -10.0, "sensor.noise": 0.0, "sensor.adc_bits": 0})
    hidden = hidden_effect(11, base, name=name)
    assert hidden.name == name
    assert hidden.parameters != base
    t = TS * np.arange(20_000)
    drive = 8 * np.sin(2 * np.pi * 5 * t) + np.sin(2 * np.pi * 700 * t)
    plain, changed = (Plant(p, TS, seed=1).run(drive).displacement for p in (base, hidden.parameters))
    assert np.std(changed - plain) > 1e-6 * base.full_stroke
    off = hidden.parameters.with_values({q: base.to_mapping()[q] for q in hidden.changes})
    np.testing.assert_array_equal(Plant(off, TS, seed=1).run(drive).displacement, plain)


def test_seeds_draw_every_effect_and_the_same_one_again():
    drawn = [hidden_effect(seed) for seed in range(200)]
    assert {h.name for h in drawn} == set(HIDDEN_EFFECTS)
    assert drawn[17] == hidden_effect(17)


def test_an_unknown_hidden_effect_is_refused():
    with pytest.raises(ParameterError, match="gremlins"):
        hidden_effect(0, name="gremlins")


@pytest.mark.parametrize("parameters", [PlantParameters(), EVERYTHING], ids=["default", "everything"])
def test_parameters_survive_a_mapping(parameters):
    assert PlantParameters.from_mapping(parameters.to_mapping()) == parameters
    names = [row.name for row in PlantParameters.table()]
    assert names == list(parameters.to_mapping())


def test_a_nested_mapping_as_yaml_gives_it():
    parameters = PlantParameters.from_mapping(
        {"hysteresis": {"operator": "prandtl_ishlinskii", "p1": 0}, "sensor": {"poles": 2, "noise": 1e-3}}
    )
    assert parameters.hysteresis.A == 0.0
    assert len(parameters.hysteresis.play_radii) >= 12
    assert parameters.hysteresis.p1 == 0.0
    assert parameters.sensor.poles == 2


@pytest.mark.parametrize(
    ("mapping", "names"),
    [
        ({"creep.gama": 0.1}, "gamma"),
        ({"kreep.gamma": 0.1}, "creep"),
        ({"gamma": 0.1}, "creep"),
        ({"creep.gamma": "much"}, r"creep\.gamma"),
        ({"creep.gamma": float("nan")}, r"creep\.gamma"),
        ({"sensor.poles": 1.5}, "whole"),
        ({"sensor.noise": -1.0}, r"sensor\.noise"),
        ({"hysteresis.operator": "preisach"}, "bouc_wen"),
        ({"electronics.voltage_max": 11.0}, "voltage_max"),
        ({"electronics.voltage_min": 10.0}, "voltage_min"),
        ({"sub_step": 0.0}, "sub_step"),
        ({"sub_step": "short"}, "sub_step"),
    ],
)
def test_wrong_parameters_are_one_clear_line(mapping, names):
    with pytest.raises(ParameterError, match=names) as error:
        PlantParameters.from_mapping(mapping)
    assert "\n" not in str(error.value)
    assert "expected" in str(error.value)
