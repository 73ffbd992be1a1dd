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

"""Poles of the dynamics that a step would move beyond the unit circle do not hold back the rest of the fit."""

import numpy as np
import pytest

from piezo_hysteresis.effects import Arx, ThermalDrift
from piezo_hysteresis.identification.fit.fit import fit
from piezo_hysteresis.identification.fit.stable_step import stable_step
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Record

PERIOD, NOISE = 1e-3, 1e-8
TIME = PERIOD * np.arange(4000)
DRIVE = 5.0 * (1.0 - np.cos(4.0 * np.pi * TIME)) + np.sin(22.0 * np.pi * TIME)
FREE = ("arx.a[0]", "arx.a[1]", "arx.b[0]", "arx.b[1]", "thermal_drift.D", "thermal_drift.tau")


def stage(poles, zero, drift, tau):
    a, b = np.poly(poles), np.array([1.0, -zero])
    arx = Arx(a=tuple(a[1:]), b=tuple(b * a.sum() / b.sum()), delay=1.0)
    return Model((arx, ThermalDrift(D=drift, tau=tau)), PERIOD, 10.0, 1e-5)


def stage_with_drift(seed):
    (displacement,) = stage((0.5, 0.0), 0.0, 2e-6, 2.0).simulate([Record(DRIVE, np.zeros(TIME.size), PERIOD)])
    return Record(DRIVE, displacement + NOISE * np.random.default_rng(seed).normal(size=TIME.size), PERIOD)


@pytest.mark.parametrize("pole", [-0.99, -0.999])
@pytest.mark.parametrize("seed", range(3))
def test_a_pole_that_the_drive_does_not_determine_does_not_hold_back_the_drift(pole, seed):
    """The drive has no power at the frequency of the superfluous pole, so that noise moves it beyond the circle."""
    start = stage((0.45, pole), pole - 1e-3, 1e-7, 5.0)
    found = fit(start, [stage_with_drift(seed)], FREE, floors=[NOISE], max_iterations=9, tolerance=1e-3)
    assert found.converged
    assert found.cost == pytest.approx(1.0, abs=0.02)
    assert found.values["thermal_drift.D"] == pytest.approx(2e-6, rel=0.01)
    assert found.values["thermal_drift.tau"] == pytest.approx(2.0, rel=0.01)


MODEL = stage((0.5, -0.9), -0.8, 1e-6, 5.0)
ROOM = (np.full(6, -np.inf), np.full(6, np.inf))


def step_to(minimum, seed=0):
    """The step, and the matrix of a cost whose minimum is there."""
    root = np.random.default_rng(seed).normal(size=(6, 6))
    hessian = root @ root.T
    return stable_step(MODEL, FREE, np.eye(6), hessian, hessian @ minimum, ROOM), hessian


@pytest.mark.parametrize("seed", range(5))
def test_the_other_parameters_take_their_best_values_for_poles_that_are_stable(seed):
    minimum = np.array([3.0, 2.0, 0.1, -0.2, 0.3, 0.4])
    step, hessian = step_to(minimum, seed)
    assert np.abs(np.roots([1.0, *(MODEL["arx"].array("a") + step[:2])])).max() < 1.0
    assert step[:2].any()
    np.testing.assert_allclose((hessian @ (step - minimum))[2:], 0.0, atol=1e-9)


def test_a_step_to_stable_poles_is_taken_whole():
    minimum = np.array([0.1, 0.1, 0.1, -0.2, 0.3, 0.4])
    np.testing.assert_allclose(step_to(minimum)[0], minimum)


@pytest.mark.parametrize("seed", range(5))
def test_no_step_leads_to_a_pole_whose_sensitivities_are_rounding_errors(seed):
    """The rows of poles and zeros near 1 cancel: at 1 − 1e-9, one of them is 1e18 times what both change together."""
    toward = np.poly([0.5, 1.0 - 1e-9])[1:] - MODEL["arx"].array("a")
    step, _ = step_to(np.array([*toward, 0.1, -0.2, 0.3, 0.4]), seed)
    assert np.abs(np.roots([1.0, *(MODEL["arx"].array("a") + step[:2])])).max() < 1.0 - 1e-6


@pytest.mark.parametrize("radius", [1.0 - 1e-7, 1.0 - 1e-12])
def test_a_model_whose_pole_is_there_already_keeps_it(radius):
    model = stage((0.5, radius), radius - 1e-3, 1e-6, 5.0)
    minimum = np.array([3.0, 2.0, 0.1, -0.2, 0.3, 0.4])
    step = stable_step(model, FREE, np.eye(6), np.eye(6), minimum, ROOM)
    assert np.abs(np.roots([1.0, *(model["arx"].array("a") + step[:2])])).max() <= radius
    np.testing.assert_allclose(step[2:], minimum[2:])
