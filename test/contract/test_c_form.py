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

"""What every effect promises about its C form: it agrees with the model, or says why there is none."""

from __future__ import annotations

import re
import subprocess

import numpy as np
import pytest

from piezo_hysteresis.compensation import Band, Inverse, Limits
from piezo_hysteresis.effects import (
    CHAIN,
    AmplifierSaturation,
    Arx,
    BoucWen,
    Effect,
    Invertibility,
    Offset,
    PublishedBoucWen,
    SensorBandwidth,
    SofteningOfOneMode,
)
from piezo_hysteresis.errors import ModelError
from piezo_hysteresis.export import c_program

from .compiled import compiled, needs_compiler, run_c
from .test_effect import channels, drive, model_with, run, typical
from .test_inverse import drive as turned_drive
from .test_inverse import model_with as turned_model_with
from .test_inverse import typical as turned_typical

WORST = 1e-12
"""Largest deviation, as a share of the largest displacement."""


@needs_compiler
@pytest.mark.parametrize("kind", CHAIN, ids=lambda kind: kind.name)
def test_c_code_agrees_or_the_effect_states_why_there_is_none(kind: type[Effect], tmp_path) -> None:
    model, u = model_with(typical(kind)), drive()
    files, refusal = {}, ""
    try:
        files = c_program(model)
    except ModelError as error:
        refusal = str(error)
    if refusal:
        assert kind.name in refusal and "cannot be exported" in refusal
        return
    used = model.at(model.sample_period).channels
    rows = [u, *(channels()[name] for name in channels() if name in used)]
    y, expected = run_c(files, tmp_path, u[0], rows), run(model, u)
    assert y.size == u.size
    assert np.abs(y - expected).max() <= WORST * np.abs(expected).max()


@needs_compiler
def test_all_effects_of_one_chain_agree_together(tmp_path) -> None:
    apart = (PublishedBoucWen, SofteningOfOneMode, BoucWen, Arx, Offset)  # others stand for them, or they are there
    model, u = model_with(*(typical(kind) for kind in CHAIN if kind not in apart)), drive()
    files = c_program(model)
    assert subprocess.run([compiled(files, tmp_path)], check=False).returncode == 0
    rows = [u, *(channels()[name] for name in sorted(channels()))]
    y, expected = run_c(files, tmp_path, u[0], rows), run(model, u)
    assert np.abs(y - expected).max() <= WORST * np.abs(expected).max()


@needs_compiler
@pytest.mark.parametrize(("lower", "upper", "corner"), [(-1.0, 1.0, 1.5), (0.0, 8.0, 4.5), (0.0, 5.0, 50.0)])
def test_a_saturation_whose_bends_overlap_is_inverted(lower: float, upper: float, corner: float, tmp_path) -> None:
    model = turned_model_with(AmplifierSaturation(lower=lower, upper=upper, corner=corner))
    u = 0.5 * (lower + upper) + 0.8 * (0.5 * (upper - lower) + corner) * np.sin(np.arange(600) / 20.0)
    path, inverse = model.run(u, model.rest(u[0]))[0], Inverse(model)
    turned, _ = inverse.run(path, inverse.rest(u[0]))
    np.testing.assert_allclose(turned[inverse.preview :], u[: -inverse.preview], rtol=0.0, atol=1e-6 * np.ptp(u))
    in_c = run_c(c_program(model, inverse=inverse), tmp_path, u[0], [path], "inverse_")
    np.testing.assert_allclose(in_c, turned, rtol=0.0, atol=1e-9 * np.ptp(u))


@needs_compiler
@pytest.mark.parametrize("kind", CHAIN, ids=lambda kind: kind.name)
def test_the_inverse_in_c_agrees(kind: type[Effect], tmp_path) -> None:
    left_out = kind.invertibility is Invertibility.IMPOSSIBLE
    model = turned_model_with(turned_typical(kind), *([SensorBandwidth(tau=1e-4)] if left_out else []))
    inverse = Inverse(model, Limits(0.0, 4.0, 1e5), band=Band.of(model.sample_period), approximate=left_out)
    path, _ = model.run(turned_drive(), model.rest(0.0))
    expected, _ = inverse.run(path, inverse.rest(2.0))
    files = c_program(model, inverse=inverse)
    assert not re.search(r"\bf(min|max)\(", files["piezo.c"]), "calls of a library where `smaller` and `larger` serve"
    u = run_c(files, tmp_path, 2.0, [path], "inverse_")
    assert u.size == path.size
    assert np.abs(u - expected).max() <= WORST * max(inverse.noise_gain, 1.0) * np.abs(expected).max()
