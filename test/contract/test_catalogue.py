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

"""The public vocabulary: identifiers and families that files, ROS parameters, the command and its answers use."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

from piezo_hysteresis.effects import BASELINE, BY_NAME, CATALOGUE, CHAIN, FINER_FORMS, UNNAMED

DOCS = Path(__file__).parents[2] / "docs"

FAMILIES = {
    "creep": "creep",
    "creep_exponential": "creep",
    "creep_fractional": "creep",
    "thermal_drift": "drift",
    "thermal_expansion": "drift",
    "gain_drift": "drift",
    "even_input_polynomial": "static",
    "sensor_nonlinearity": "static",
    "asymmetric_hysteresis": "hysteresis",
    "hysteresis_exponent": "hysteresis",
    "hysteresis_memory": "hysteresis",
    "rate_dependent_hysteresis": "hysteresis",
    "initial_state": "hysteresis",
    "backlash": "hysteresis",
    "softening": "dynamics",
    "softening_of_one_mode": "dynamics",
    "extra_resonance": "dynamics",
    "extra_delay": "lag",
    "amplifier_bandwidth": "lag",
    "amplifier_bandwidth_held": "lag",
    "sensor_bandwidth": "lag",
    "amplifier_slew_limit": "amplifier",
    "amplifier_saturation": "amplifier",
    "mains_hum": "disturbance",
    "axis_coupling": "disturbance",
}


def test_names_and_families_are_the_published_ones() -> None:
    assert {e.name: e.family for e in CATALOGUE} == FAMILIES


def test_every_effect_is_in_the_chain_once_and_in_order() -> None:
    assert len(BY_NAME) == len(CHAIN)
    assert set(BASELINE) | set(CATALOGUE) | set(FINER_FORMS) | set(UNNAMED) == set(CHAIN)
    assert not set(UNNAMED) & set(CATALOGUE)
    places = [e.place for e in CHAIN]
    assert places == sorted(places)


def test_file_class_and_identifier_are_one_word() -> None:
    for effect in CHAIN:
        assert effect.__module__.rpartition(".")[2] == effect.name
        assert effect.__name__ == "".join(part.capitalize() for part in effect.name.split("_"))


def test_the_page_agrees_with_the_classes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(DOCS))
    generated = runpy.run_path(str(DOCS / "generate.py"))["catalogue"]()
    assert (DOCS / "catalogue.md").read_text() == generated, "run make docs"
