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

"""A model file carries a model bit for bit, and refuses everything that is not one in a single clear line."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, assume, example, given, settings
from hypothesis import strategies as st

from piezo_hysteresis.effects import BY_NAME, CHAIN, Arx, BoucWen, Offset
from piezo_hysteresis.errors import ModelError, ParameterError, PiezoError
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.model.model_file import dumps, load, loads, save
from piezo_hysteresis.model.model_parameters import from_parameters, hash_number, model_hash, to_parameters
from piezo_hysteresis.model.parameter_covariance import ParameterCovariance
from piezo_hysteresis.model.parameter_file import parameters
from piezo_hysteresis.parameter import Parameter
from piezo_hysteresis.record import Record

MODEL = Model((BoucWen(), Arx(a=[-0.5], b=[1e-05, 0.5]), Offset(y0=3e-9)), 2e-5, displacement_scale=1e-6)
PUBLISHED = Path(__file__).parents[2] / "config" / "published_stage.yaml"


def _values(row: Parameter) -> st.SearchStrategy:
    low, high = max(row.lower, -row.scale), min(row.upper, row.scale)
    number = st.floats(low, high, allow_subnormal=False) if low <= high else st.just(row.lower)
    if not row.is_array:
        return number | st.just(row.value)
    # |a_i| < 1/4 keeps any four poles stable
    return st.lists(number.map(lambda x: x / 4.1 if low <= x / 4.1 <= high else x), max_size=4)


@st.composite
def models(draw: st.DrawFn) -> Model:
    kinds = draw(st.sets(st.sampled_from(CHAIN), min_size=1, max_size=6))
    kinds |= {BY_NAME[kind.host] for kind in kinds if kind.host}
    try:
        effects = tuple(kind(**{row.name: draw(_values(row)) for row in kind.parameters}) for kind in kinds)
    except ParameterError:
        assume(False)
    scales = st.floats(1e-9, 1e3)
    words = st.text(st.characters(exclude_categories=["Cs"]))
    return Model(
        effects,
        draw(scales),
        draw(scales),
        draw(scales),
        draw(st.dictionaries(st.from_regex(r"[a-z][a-z0-9_]{0,8}", fullmatch=True), words, max_size=3)),
    )


def _same(one: Model, other: Model) -> None:
    assert one.effects == other.effects
    for name in ("sample_period", "voltage_scale", "displacement_scale"):
        assert getattr(one, name) == getattr(other, name)
    assert dict(one.provenance) == dict(other.provenance)


@settings(max_examples=60, suppress_health_check=[HealthCheck.filter_too_much, HealthCheck.too_slow])
@given(models())
def test_text_and_parameters_store_any_model_bit_for_bit(model: Model) -> None:
    _same(loads(dumps(model)), model)
    _same(from_parameters(to_parameters(model)), model)


@settings(max_examples=25, suppress_health_check=[HealthCheck.filter_too_much, HealthCheck.too_slow])
@example(Model(MODEL.effects, 2e-5, provenance={"no": "", "on": "x", "run": "3"}))
@given(models())
def test_pyyaml_reads_the_same_numbers_as_rcl(model: Model) -> None:
    """`ros2 param load` goes through PyYAML, `--params-file` through rcl."""

    def flat(tree: dict, prefix: str = "") -> dict:
        items: dict = {}
        for key, value in tree.items():
            items |= flat(value, f"{prefix}{key}.") if isinstance(value, dict) else {prefix + key: value}
        return items

    text = dumps(model)
    assert flat(yaml.safe_load(text)["/**"]["ros__parameters"]) == parameters(text)["/**"]


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_every_number_survives(number: float) -> None:
    text = dumps(MODEL.with_values({"bouc_wen.p2": 1.0})).replace("p2: 1.0", f"p2: {number!r}")
    (read,) = {v for n, v in parameters(text)["/**"].items() if n == "model.bouc_wen.p2"}
    assert read == number


@pytest.mark.parametrize("key", ["/**", "/stage_x/identification_node", "identification_node"])
def test_a_parameter_dump_is_a_model_file(key: str) -> None:
    """As `ros2 param dump` writes it: keyed by the node, sorted, other parameters around, no decimal points."""
    tree: dict = {"protocol": "short", "use_sim_time": False, "qos": {"depth": 3}, "model": {}}
    for name, value in to_parameters(MODEL).items():
        into = tree
        *path, last = name.split(".")
        for part in path:
            into = into.setdefault(part, {})
        into[last] = value
    text = yaml.safe_dump({key: {"ros__parameters": tree}}).replace("1.0e-05", "1e-05")
    _same(loads(text), MODEL)


def test_numbers_in_the_provenance_stay_numbers() -> None:
    model = Model(MODEL.effects, 2e-5, provenance={"free_run_error": "1e-08", "run": "1e-8", "data": "1234e567"})
    assert to_parameters(model)["model.provenance.free_run_error"] == 1e-08
    _same(loads(dumps(model)), model)


def test_hash_distinguishes_models_and_ignores_their_provenance() -> None:
    other = Model(MODEL.effects, 2e-5, displacement_scale=1e-6, provenance={"date": "2020-01-01"})
    assert model_hash(other) == model_hash(MODEL)
    next_up = MODEL.with_values({"arx.b[0]": float(np.nextafter(1e-05, 1.0))})
    assert model_hash(next_up) != model_hash(MODEL)
    assert model_hash(MODEL).startswith(f"sha256:{hash_number(MODEL):08x}")


def test_the_covariance_of_the_numbers_is_kept() -> None:
    rng = np.random.default_rng(1)
    names = ("bouc_wen.A", "arx.b[0]", "offset.y0")
    root = np.diag([1e-2, 1e-6, 1e-10]) @ rng.normal(size=(3, 2))  # one direction is exactly known
    stated = replace(MODEL, covariance=ParameterCovariance.of(names, root @ root.T))
    again = loads(dumps(stated))
    assert again.covariance is not None and tuple(again.covariance.names) == names
    np.testing.assert_allclose(again.covariance.matrix, root @ root.T, rtol=1e-7, atol=0.0)
    assert model_hash(stated) == model_hash(MODEL) == model_hash(again)
    assert dumps(again) == dumps(stated)
    assert loads(dumps(MODEL)).covariance is None
    for old, new, message in (
        ('["bouc_wen.A", ', '["bouc_wen.A", "x", ', "same number"),
        ('["bouc_wen.A", ', "[3.0, ", "covariance.names"),
        ("        factor:", "        factors:", "covariance.factor' is missing"),
        ("        factor: [", '        factor: ["a", ', "expected a number"),
    ):
        with pytest.raises(ModelError, match=message):
            loads(dumps(stated).replace(old, new))


def test_the_standard_error_is_the_spread_of_models_drawn_from_the_covariance() -> None:
    rng = np.random.default_rng(2)
    names = ("bouc_wen.p2", "bouc_wen.beta", "offset.y0")
    root = np.diag([1e-3, 1e-2, 2e-10]) @ np.array([[1.0, 0.0, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    stated = replace(MODEL, covariance=ParameterCovariance.of(names, root @ root.T))
    drive = 2.0 - 2.0 * np.cos(2 * np.pi * np.arange(400) / 200)
    first = Record(drive, np.zeros(400), 2e-5)
    records = [first, Record(drive, np.zeros(400), 2e-5, start_time=first.duration, continues=True)]
    middle = np.array([MODEL.values()[name] for name in names])
    models = [
        MODEL.with_values(dict(zip(names, numbers, strict=True)))
        for numbers in middle + rng.normal(size=(800, 3)) @ root.T
    ]
    drawn = [np.concatenate([y - y.mean() for y in model.simulate(records)]) for model in models]
    stated_errors = np.concatenate(stated.standard_errors(records))
    np.testing.assert_allclose(stated_errors, np.std(drawn, axis=0), rtol=0.1)
    with pytest.raises(ModelError, match="without the covariance"):
        MODEL.standard_errors(records)


def test_a_lost_empty_array_is_noticed() -> None:
    text = "\n".join(line for line in dumps(MODEL).splitlines() if " a: " not in line)
    with pytest.raises(ModelError, match=r"model\.hash.*delete model\.hash"):
        loads(text)
    assert loads("\n".join(line for line in text.splitlines() if " hash:" not in line))["arx"].array("a").size == 0


def test_save_and_load(tmp_path: Path) -> None:
    path = save(MODEL, tmp_path / "new" / "model.yaml")
    _same(load(path), MODEL)
    assert [p.name for p in path.parent.iterdir()] == ["model.yaml"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("p2: 2.1925", "p3: 2.1925", "'model.bouc_wen.p2' is missing"),
        ("p2: 2.1925", "p2: 2.1925\n        p9: 1.0", "unknown 'model.bouc_wen.p9'"),
        ("p2: 2.1925", "p2: 2", "expected a number .* with a decimal point; write 2.0"),
        ("p2: 2.1925", "p2: 2.1925 V", "got '2.1925 V', expected a number"),
        ("p2: 2.1925", "p2: true", "got True, expected a number"),
        ("p2: 2.1925", "p2: [2.0]", "expected a number"),
        ("p2: 2.1925", "p2: .nan", "expected -1000 to 1000"),
        ("beta: 4.6075", "beta: 0.1", "beta >= |gamma|"),
        ("a: [-0.5]", "a: [-1.5]", "unstable"),
        ("a: [-0.5]", "a: -0.5", "expected a list of numbers"),
        ("a: [-0.5]", "a: [-0.5, 1]", r"model.arx.a\[1\]: got 1, expected a number"),
        ("sample_period: 2.0e-05", "sample_period: -2.0e-05", "sample_period: got -2e-05"),
        ("sample_period: 2.0e-05", "sample_period: 20 us", "got '20 us', expected a number .s."),
        ("sample_period: 2.0e-05", "", "'model.sample_period' is missing"),
        ("voltage_scale: 10.0", "voltage_scale: 11.0", "model.hash"),
        ("valid: true", "valid: false", "identify the stage first"),
        ('"bouc_wen", ', "", "unknown 'model.bouc_wen"),
        ('"bouc_wen"', '"bouc_wem"', "unknown effect 'bouc_wem'"),
        ('["bouc_wen", "arx", "offset"]', "bouc_wen", "expected a list of effect names"),
        ("/**:", "/**: [", "broken YAML in line"),
        ("    model:", "    modell:", "no 'model'"),
        ("ros__parameters", "parameters", "no 'ros__parameters'"),
        ("p2: 2.1925", "p2: 2.1925\n        p2: 2.1925", "given twice"),
        ("p2: 2.1925", "p2: [[1.0]]", "list of lists"),
    ],
)
def test_an_invalid_model_file_is_refused_in_one_line(old: str, new: str, message: str) -> None:
    text = dumps(MODEL)
    assert old in text
    with pytest.raises(PiezoError, match=message.replace("|", r"\|")) as error:
        loads(text.replace(old, new, 1), "model.yaml")
    assert "\n" not in str(error.value)
    assert str(error.value).startswith("model.yaml")


def test_two_different_models_in_one_file_are_refused() -> None:
    other = dumps(MODEL.with_values({"offset.y0": 1e-6})).replace("/**", "/b")
    with pytest.raises(ModelError, match="2 different models"):
        loads(dumps(MODEL).replace("/**", "/a") + other)
    _same(loads(dumps(MODEL).replace("/**", "/a") + dumps(MODEL).replace("/**", "/b")), MODEL)


@pytest.mark.parametrize("text", ["", "\0", "[" * 1500, "- 1", "a: &x {b: *x}", "? {a: 1}\n: 2"])
def test_any_text_is_refused_in_one_line(text: str) -> None:
    with pytest.raises(PiezoError) as error:
        loads(text)
    assert "\n" not in str(error.value)


def test_a_file_that_cannot_be_written_leaves_no_draft(tmp_path: Path) -> None:
    (tmp_path / "model.yaml").mkdir()
    with pytest.raises(ModelError, match="cannot write the model file"):
        save(MODEL, tmp_path / "model.yaml")
    assert [path.name for path in tmp_path.iterdir()] == ["model.yaml"]


def test_a_missing_file_and_a_foreign_one(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="No such file"):
        load(tmp_path / "absent.yaml")
    (tmp_path / "image.yaml").write_bytes(b"\xff\xd8\xff")
    with pytest.raises(ModelError, match="UTF-8"):
        load(tmp_path / "image.yaml")


def test_a_pipe_and_a_folder_are_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path, tmp_path / "pipe"):
        with pytest.raises(ModelError, match="expected a regular file"):
            load(path)


def test_the_published_stage_contains_the_values_of_the_paper() -> None:
    model = load(PUBLISHED)
    assert parameters(dumps(model)) == parameters(PUBLISHED.read_text())
    assert model["arx"]["delay"] == 3.0
    assert round(model["arx"].dc_gain, 5) == 0.24641
    assert model["published_bouc_wen"].values == {
        "A": -0.7691, "beta": 4.6075, "gamma": -0.8725, "p1": -0.1085, "p2": 2.1925, "n": 1.0,
    }  # fmt: skip
