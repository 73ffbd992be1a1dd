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

"""The exported C program as a whole: what it promises to somebody who has only its files."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from piezo_hysteresis import __version__
from piezo_hysteresis.blocks.block import Block
from piezo_hysteresis.compensation import Inverse, Limits
from piezo_hysteresis.effects import (
    AmplifierBandwidth,
    AmplifierSlewLimit,
    Arx,
    BoucWen,
    Creep,
    HysteresisExponent,
    HysteresisMemory,
    Offset,
)
from piezo_hysteresis.effects.sensor.sensor_nonlinearity import SensorNonlinearity, SensorNonlinearityBlock
from piezo_hysteresis.errors import ModelError
from piezo_hysteresis.export import c_program
from piezo_hysteresis.model.model import Model

from ..contract.compiled import compiled, needs_compiler, run_c

PERIOD = 2e-5
MODEL = Model(
    (
        BoucWen(),
        HysteresisMemory(c=(0.05, 0.03, 0.02)),
        Creep(gamma=0.012),
        Arx(a=[-1.6, 0.9, -0.1], b=[0.1, 0.2, 0.05], delay=37.4),
        Offset(y0=2e-7, settling=0.01),
    ),
    PERIOD,
    10.0,
    1e-5,
    {"voltage_min": "1.0", "voltage_max": "9.0", "source": "a folder */ with an odd name"},
)


def drive() -> np.ndarray:
    """Noise, a hold and a sine [V]."""
    rng = np.random.default_rng(3)
    t = PERIOD * np.arange(20_000)
    return np.concatenate((4.0 + rng.normal(scale=0.7, size=5_000), np.full(5_000, 6.0), 5.0 + 3.0 * np.sin(900.0 * t)))


def has_fused_multiply_add() -> bool:
    """Whether this processor rounds x y + z once, as the kernels then do."""
    return "fma" in re.findall(r"\w+", Path("/proc/cpuinfo").read_text()) if Path("/proc/cpuinfo").exists() else False


@needs_compiler
def test_the_self_test_passes_and_notices_another_number(tmp_path):
    files = c_program(MODEL)
    program = compiled(files, tmp_path)
    done = subprocess.run([program], capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "largest deviation" in done.stdout, done.stdout + done.stderr
    spoilt = files["piezo.c"].replace(repr(BoucWen()["beta"]), repr(BoucWen()["beta"] * (1.0 + 1e-9)))
    assert spoilt != files["piezo.c"]
    program = compiled({**files, "piezo.c": spoilt}, tmp_path)
    assert subprocess.run([program], capture_output=True, check=False).returncode == 1


@needs_compiler
def test_the_inverse_of_a_loop_with_exponent_passes_at_a_round_slew_limit(tmp_path):
    effects = (BoucWen(), HysteresisExponent(n=1.3), AmplifierSlewLimit(S=2e4), Arx(a=[-1.2, 0.5], b=[0.2, 0.06]))
    model = Model(effects, PERIOD, 10.0, 1e-5)
    program = compiled(c_program(model, inverse=Inverse(model)), tmp_path)
    done = subprocess.run([program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


@needs_compiler
def test_the_self_test_of_a_stage_with_slow_poles_and_a_resonance_passes(tmp_path):
    """Creep that the ARX describes: without fused multiply-add, rounding moved y by 2e-11 and u by 3e-11."""
    slow, ringing = [0.99983, 0.99745, 0.93, 0.15], [0.9776 * np.exp(0.56j), 0.9776 * np.exp(-0.56j)]
    a, b = np.poly(slow + ringing).real, np.poly([0.99984, 0.9976, 0.935, -0.2]).real
    effects = (BoucWen(), Arx(a=a[1:], b=b * a.sum() / b.sum(), delay=3))
    model = Model(effects, PERIOD, 10.0, 1e-5)
    program = compiled(c_program(model, inverse=Inverse(model)), tmp_path)
    done = subprocess.run([program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


@needs_compiler
def test_the_inverse_of_a_pole_much_faster_than_a_sample_is_exact(tmp_path):
    model = Model((AmplifierBandwidth(tau=2e-5), BoucWen(), Arx(b=[0.5], delay=1)), 1e-3, 10.0, 1e-5)
    inverse = Inverse(model)
    wanted = model.simulate(4.0 - 4.0 * np.cos(2.0 * np.pi * 100.0 * 1e-3 * np.arange(300)))
    u = run_c(c_program(model, inverse=inverse), tmp_path, 0.0, [wanted], "inverse_")
    reached = model.simulate(u)[inverse.preview :]
    np.testing.assert_allclose(reached, wanted[: reached.size], rtol=0.0, atol=1e-12 * np.ptp(wanted))


@needs_compiler
@pytest.mark.skipif(not has_fused_multiply_add(), reason="no fused multiply-add here: equal to rounding only")
def test_every_bit_is_that_of_the_model_where_the_rounding_is(tmp_path):
    expected, _ = MODEL.run(drive(), MODEL.rest(drive()[0]))
    y = run_c(c_program(MODEL), tmp_path, drive()[0], [drive()], "", "-O2", "-mfma", "-ffp-contract=off")
    np.testing.assert_array_equal(y, expected)


@needs_compiler
def test_the_inverse_leads_the_exported_prediction_along_the_path(tmp_path):
    inverse = Inverse(MODEL, Limits(0.0, 10.0))
    files = c_program(MODEL, inverse=inverse)
    assert subprocess.run([compiled(files, tmp_path)], check=False).returncode == 0
    path = 2e-6 + 1e-6 * (1.0 - np.cos(300.0 * PERIOD * np.arange(4_000)))
    start = float(MODEL.run([1.0], MODEL.rest(1.0))[0][0])
    path = np.concatenate((np.full(200, start), start + path - path[0]))
    u = run_c(files, tmp_path, 1.0, [path], "inverse_")
    reached = run_c(files, tmp_path, 1.0, [u])
    settled = slice(200, path.size - inverse.preview)
    np.testing.assert_allclose(reached[inverse.preview :][settled], path[settled], rtol=0.0, atol=1e-9 * path.max())
    assert u.min() >= 0.0 and u.max() <= 10.0
    assert f"PIEZO_INVERSE_PREVIEW {inverse.preview} " in files["piezo.h"]


@needs_compiler
def test_a_sample_that_is_not_finite_ends_the_block(tmp_path):
    u = drive()[:300].copy()
    u[250] = np.nan
    assert run_c(c_program(MODEL), tmp_path, u[0], [u]).size == 250


@needs_compiler
def test_two_models_and_cpp_share_a_program(tmp_path):
    files = {**c_program(MODEL, "stage_x"), **c_program(MODEL.without("creep"), "stage_y")}
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "both.cpp").write_text(
        '#include "stage_x.h"\n#include "stage_y.h"\nint main() { stage_x_state x; stage_y_state y;\n'
        "stage_x_reset(&x, 1.0); stage_y_reset(&y, 1.0); return stage_x_step(&x, 2.0) == stage_y_step(&y, 2.0); }\n"
    )
    strict = ("-Wall", "-Wextra", "-Werror")
    for command in (
        ["gcc", *strict, "-std=c99", "-c", "stage_x.c", "stage_y.c"],
        *([["g++", *strict, "both.cpp", "stage_x.o", "stage_y.o", "-lm", "-o", "both"], ["./both"]] * bool(
            shutil.which("g++")
        )),
    ):  # fmt: skip
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr


@needs_compiler
@pytest.mark.parametrize("name", ["arx", "creep", "hysteresis_bouc_wen", "inverse_arx", "ramp"])
def test_a_name_that_a_block_has_too_compiles(name, tmp_path):
    files = c_program(MODEL, name, Inverse(MODEL))
    for file, text in files.items():
        (tmp_path / file).write_text(text)
    done = subprocess.run(
        ["gcc", "-Wall", "-Wextra", "-Werror", "-std=c99", *sorted(f for f in files if f.endswith(".c")), "-lm"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def test_the_header_identifies_the_model():
    header = c_program(MODEL, "stage_x")["stage_x.h"]
    (digest,) = re.findall(r'#define STAGE_X_MODEL_HASH "(sha256:\w+)"', header)
    assert digest in c_program(MODEL)["piezo.h"]
    assert digest not in c_program(MODEL.with_values({"creep.gamma": 0.013}))["piezo.h"]
    assert f'STAGE_X_VERSION "{__version__}"' in header and "STAGE_X_SAMPLE_PERIOD 2e-05 /* s */" in header
    assert "gamma = 0.012 [1/decade]" in header and "y0 = 2e-07 [m]" in header


def test_the_state_is_the_only_memory():
    source = c_program(MODEL)["piezo.c"]
    code = re.sub(r"/\*.*?\*/", "", source, flags=re.DOTALL)
    assert not re.search(r"\b(malloc|calloc|realloc|alloca|free)\b", code)
    assert re.findall(r'#include [<"](\S+)[>"]', code) == ["piezo.h", "math.h", "string.h"]
    for declared in re.findall(r"^ *static (?!const).*$", code, flags=re.MULTILINE):
        assert "(" in declared, declared  # functions only: nothing that two stages would share


def test_a_block_without_a_c_form_is_refused_by_name(monkeypatch):
    monkeypatch.setattr(SensorNonlinearityBlock, "c_form", Block.c_form)
    with pytest.raises(ModelError, match=r"sensor_nonlinearity: has no C form, so the model cannot be exported"):
        c_program(MODEL.with_effect(SensorNonlinearity(s2=0.01)))


def test_the_inverse_of_another_model_is_refused():
    with pytest.raises(ModelError, match="inverse: got that of another model"):
        c_program(MODEL, inverse=Inverse(MODEL.with_values({"bouc_wen.A": 0.5})))


@pytest.mark.parametrize("name", ["math", "string", "stdint"])
def test_a_name_that_hides_a_header_of_c_is_refused(name):
    """math.c included itself, and did not compile."""
    with pytest.raises(ModelError, match=f"{name}.h would hide it"):
        c_program(MODEL, name)


@pytest.mark.parametrize("name", ["", "2x", "Stage", "a-b", "x/y", "é"])
def test_a_name_that_c_does_not_allow_is_refused(name):
    with pytest.raises(ModelError, match="expected lower-case letters"):
        c_program(MODEL, name)
