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

"""A small experiment on the simulated stage that creeps, and two models of it: without and with creep."""

from __future__ import annotations

import numpy as np
import pytest

from piezo_hysteresis.effects import Arx, BoucWen, Creep
from piezo_hysteresis.identification.protocol import excitation
from piezo_hysteresis.identification.protocol.drive_limits import DriveLimits
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Experiment, Notice
from piezo_hysteresis.report.figures.comparison import compare
from piezo_hysteresis.report.page import SECTIONS, page
from piezo_hysteresis.stage.plant import PlantParameters
from piezo_hysteresis.stage.simulated import SimulatedStage

A = (-0.05847, 0.2423, -0.05833, -0.4917, 0.4170, -0.1945, 0.07748, -0.01198)
B = (0.004481, 0.04629, 0.1320, 0.1154, -0.02198, -0.06236, -0.0007691, 0.01408)
GAMMA = 0.02
ANSWER = {
    "schema": 1,
    "verdict": "named",
    "effects": [
        {
            "name": "creep",
            "family": "creep",
            "member_certain": True,
            "explained_fraction": 0.97,
            "parameters": {"gamma": {"value": 0.0143, "interval_95": [0.0139, 0.0147], "unit": "1/decade"}},
            "confusable_with": [],
            "held_out_gain": 2.31,
        }
    ],
    "where": [{"axis": "time_since_level_change", "share": 0.81, "detail": "more than 1 s after a change of level"}],
    "gap_percent_of_range": {
        "before": 0.72,
        "after": 0.04,
        "floor": 0.03,
        "per_phase": {"triangle": {"before": 0.9, "after": 0.05, "floor": 0.03}},
    },
    "rejected": [{"name": "thermal_drift", "reason": "loses <0.4> on held-out phases"}],
    "next_experiment": {"phase": "staircase", "separates": ["creep", "thermal_drift"]},
    "data_quality": [],
    "model": "better.yaml",
}


@pytest.fixture(scope="session")
def experiment() -> Experiment:
    limits = DriveLimits()
    stage = SimulatedStage(PlantParameters().with_values({"creep.gamma": GAMMA}), seed=5)
    drives = (
        ("rest", excitation.hold(limits, 0.0, 0.1), 1),
        ("step", excitation.steps(limits, (0.2, 0.8) * 3, 0.01), 1),
        ("noise", excitation.noise(limits, 0.012, 10e3, 0.2, centre=0.35, seed=1), 1),
        ("triangle", excitation.triangle(limits, (1.0, 0.75, 0.5, 0.25), 1.0), 10),
        ("sine_1hz", excitation.sine(limits, 1.0, 2.0), 10),
        ("sine_200hz", excitation.sine(limits, 200.0, 0.05), 1),
        ("staircase", excitation.steps(limits, (0.0, 0.5, 1.0, 0.5, 0.0), 3.0, slew_rate=50.0), 500),
    )
    records = [
        stage.play(limits.from_safe_to_safe(drive), name, continues=i > 0, average=average)
        for i, (name, drive, average) in enumerate(drives)
    ]
    return Experiment(tuple(records), "simulated stage", (Notice("proposed", "phases <named> by their drive"),))


@pytest.fixture(scope="session")
def models() -> dict[str, Model]:
    bare = Model((BoucWen(), Arx(a=A, b=B, delay=3.0)), 2e-5, 10.0, 1e-4)
    return {"baseline": bare, "with creep": bare.with_effect(Creep(gamma=GAMMA))}


@pytest.fixture(scope="session")
def comparison(experiment, models):
    return compare(experiment, models)


@pytest.fixture(scope="session")
def bare(experiment):
    """No model at all."""
    return compare(experiment)


@pytest.fixture(scope="session")
def answer():
    """What a diagnosis writes for machines."""
    return ANSWER


@pytest.fixture(scope="session")
def drawn(comparison):
    return page(comparison, answer=ANSWER, title="A stage & its model")


@pytest.fixture(scope="session")
def figures(comparison):
    """The figures of the page by name, without their picture, which takes most of the time of a page."""
    drawings = [draw(comparison) for section in SECTIONS.values() for draw in section]
    return {drawing.name: drawing for drawing in drawings if drawing is not None}


@pytest.fixture(scope="session")
def saved(drawn, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "page.html"
    drawn.save(path)
    return path


@pytest.fixture
def signal():
    return np.random.default_rng(3)
