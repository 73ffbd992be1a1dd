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

"""The subcommands at work on a real experiment: what one writes the next one reads."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace

import numpy as np
import pytest

from piezo_hysteresis import recording
from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.identification.fit.normal_equations import Nuisance
from piezo_hysteresis.identification.free_run_error import errors
from piezo_hysteresis.identification.identified_range import identified_range
from piezo_hysteresis.model import model_file
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.stage.hidden import HIDDEN_EFFECTS


@pytest.fixture(scope="module")
def identified(folder, tmp_path_factory):
    from piezo_hysteresis.cli.main import main

    place = tmp_path_factory.mktemp("identified")
    words = [
        "identify",
        str(folder),
        "-o",
        f"{place}/model.yaml",
        "--json",
        f"{place}/model.json",
        "--orders",
        "3",
        "3",
    ]
    assert main(words) == 0
    return place


def test_identify_names_the_phase_that_it_describes_worst(piezo, folder, tmp_path):
    words = ("--orders", "3", "3", "-o", tmp_path / "model.yaml", "--json", tmp_path / "model.json")
    said = piezo("identify", folder, *words).out.splitlines()[-1]
    worst = max(json.loads((tmp_path / "model.json").read_text())["phases"], key=lambda p: p["percent_of_range"])
    assert f"The error is largest in {worst['phase']}: {worst['percent_of_range']:.3g} % of range." in said


def test_identify_writes_a_model_and_its_certainty(identified):
    answer = json.loads((identified / "model.json").read_text())
    model = model_file.load(identified / "model.yaml")
    assert answer["effects"] == [e.name for e in model.effects]
    beta = answer["parameters"]["bouc_wen.beta"]
    assert beta["interval_95"][0] < beta["value"] == model["bouc_wen"]["beta"] < beta["interval_95"][1]
    assert beta["value"] == pytest.approx(4.6075, rel=0.05), "the simulated stage is the one of the paper"
    assert answer["delay_s"] == pytest.approx(60e-6)
    assert [p["phase"] for p in answer["phases"] if not p["fitted"]] == ["validation"]
    assert answer["free_run_error_percent_of_range"] < 0.1
    assert "This is the error over the phases that were not fitted." in answer["verdict_text"]


def test_validate_reports_the_one_error_measure(piezo, identified, folder, tmp_path):
    out = tmp_path / "v.json"
    done = piezo("validate", identified / "model.yaml", folder, "--json", out)
    assert done.status == 0
    answer = json.loads(out.read_text())
    assert answer["trusted"] and f"Verdict: {answer['verdict_text']}\n" in done.out
    model, experiment = model_file.load(identified / "model.yaml"), recording.read(folder)
    table = errors(model, experiment, Nuisance(offset=True))
    assert answer["percent_of_range"] == pytest.approx(table.percent)
    assert [p["rms_m"] for p in answer["phases"]] == pytest.approx([r.rms for r in table.rows])
    assert answer["percent_of_range_by_frequency"] == {"50": pytest.approx(table.by_frequency[50.0])}
    for row in table.rows:
        assert f"{row.percent:.3f}" in done.out
        assert f"{1e9 * row.rms:.1f}" in done.out
    assert "cross-correlation" in done.out
    dependent = sum(t["decides"] and not t["independent_of_drive"] for t in answer["residual_tests"])
    assert (f"depends on the drive in {dependent} of" in done.out) == (dependent > 0)


def test_validate_draws_the_printed_results(piezo, identified, folder, tmp_path):
    triangle = folder / "04_triangle.npz"
    assert piezo("validate", identified / "model.yaml", triangle, "--figures", tmp_path / "figures").status == 0
    written = {p.name for p in (tmp_path / "figures").iterdir()}
    assert {"gap.svg", "gap.csv", "time_series.png", "residual_tests.csv"} <= written


@pytest.fixture
def late(tmp_path):
    """A model that is known from slow sines, and a later recording: its step and its ringing were never recorded."""
    period, time = 1e-3, 1e-3 * np.arange(2000)
    drive = np.concatenate((np.full(1000, 5.0), 5.0 + 4.0 * np.sin(2.0 * np.pi * time)))
    swing = Record(4.0 * np.sin(2.0 * np.pi * time), time, period, initial_voltage=0.0)
    origin = {
        **identified_range((swing,), (0,)),
        "voltage_max": "9.0",
        "largest_record_error": "1e-9",
        "unseen_records": "yes",
    }
    stage = Model((BoucWen(), Arx(a=(), b=(1.0,), delay=1.0)), period, 10.0, 1e-5, provenance=origin)
    record = Record(drive, np.zeros(drive.size), period, "step", initial_voltage=0.0)
    ringing = 1e-7 * np.exp(-time[:1000] / 0.1) * np.cos(600.0 * time[:1000])
    moved = stage.simulate(record)[0] + np.concatenate((ringing, np.zeros(2000)))
    moved += 3e-9 * np.random.default_rng(1).normal(size=drive.size)
    whole = replace(record, displacement=moved)
    recording.write(Experiment((whole[:1000], whole[1000:])), tmp_path / "later")
    return model_file.save(stage, tmp_path / "model.yaml"), tmp_path / "later", stage


def test_a_drive_outside_the_identified_range_is_the_first_cause_of_a_larger_error(piezo, late):
    model, later, stage = late
    said = piezo("validate", model, later).out.split("Verdict: ")[1]
    assert "The drive leaves the range that the model was identified on, which may be the cause." in said
    assert said.index("leaves the range") < said.index("Otherwise the stage has changed")
    known = replace(stage, provenance={**stage.provenance, "step_rate_max": "5000.0", "voltage_min": "0.0"})
    said = piezo("validate", model_file.save(known, model.with_name("known.yaml")), later).out.split("Verdict: ")[1]
    assert "have: the stage has changed" in said
    assert "leaves the range" not in said


@pytest.mark.parametrize("unseen", [True, False])
def test_the_error_of_fitted_records_does_not_bound_that_of_others(piezo, late, unseen):
    model, later, stage = late
    known = replace(stage, provenance={**stage.provenance, "unseen_records": "yes" if unseen else "no"})
    done = piezo("validate", model_file.save(known, model.with_name("known.yaml")), later)
    assert done.status == (1 if unseen else 0)
    assert ("of which none was left out" in done.out) == (not unseen)


def test_samples_that_only_determine_the_state_are_not_tested(piezo, late, tmp_path):
    model, later, _ = late
    first, second = recording.read(later)[1].split(1000)
    recording.write(Experiment((replace(first, phase="conditioning"), second)), tmp_path / "led_in")
    piezo("validate", model, tmp_path / "led_in", "--json", tmp_path / "v.json")
    answer = json.loads((tmp_path / "v.json").read_text())
    assert [t["phase"] for t in answer["residual_tests"]] == [p["phase"] for p in answer["phases"]] == ["step"]
    assert [p["phase"] for p in answer["phases_not_judged"]] == ["conditioning"], "as in the table"


def test_one_zero_for_all_phases_is_the_stricter_measure(piezo, identified, folder, tmp_path):
    piezo("validate", identified / "model.yaml", folder, "--json", tmp_path / "strict.json", "--one-zero")
    strict = json.loads((tmp_path / "strict.json").read_text())["percent_of_range"]
    model, experiment = model_file.load(identified / "model.yaml"), recording.read(folder)
    assert strict == pytest.approx(errors(model, experiment).percent)
    assert strict >= errors(model, experiment, Nuisance(offset=True)).percent


def test_identify_validate_and_python_give_the_same_error(piezo, identified, folder, tmp_path):
    found = json.loads((identified / "model.json").read_text())["phases"]
    piezo("validate", identified / "model.yaml", folder, "--json", tmp_path / "v.json")
    validated = json.loads((tmp_path / "v.json").read_text())["phases"]
    model, experiment = model_file.load(identified / "model.yaml"), recording.read(folder)
    (record,) = experiment.named("validation")
    (predicted,) = model.simulate(experiment, phase="validation")
    by_hand = np.std(record.displacement - predicted)
    for answer in (found, validated):
        (phase,) = (p for p in answer if p["phase"] == "validation")
        assert phase["rms_m"] == pytest.approx(by_hand, rel=1e-6)
        assert phase["percent_of_range"] == pytest.approx(100 * by_hand / experiment.range, rel=1e-6)


def test_report_writes_a_page_with_its_figures(piezo, identified, folder, tmp_path):
    model, triangle = identified / "model.yaml", folder / "04_triangle.npz"
    words = ["--model", f"ours={model}", "-o", tmp_path / "page.html", "--title", "The small one"]
    done = piezo("report", triangle, *words)
    assert done.status == 0
    html = (tmp_path / "page.html").read_text()
    assert "<h1>The small one</h1>" in html
    assert "ours [%]" in html
    assert (tmp_path / "page_figures" / "loops_by_amplitude.svg").exists()


@pytest.mark.parametrize(
    ("column", "factor", "status"),
    [("same", 1.02, 0), ("clipped", 1.0, 1), ("micrometres", 1e6, 1), ("bent", 1.0, 1)],
)
def test_recalibrate_says_whether_its_model_can_be_trusted(piezo, identified, folder, tmp_path, column, factor, status):
    (record,) = recording.read(folder / "04_triangle.npz")
    u, y = record.voltage, factor * record.displacement
    y = np.minimum(y, 0.9 * y.max()) if column == "clipped" else y
    y = y + 0.05 * np.ptp(y) * (y / np.ptp(y)) ** 3 if column == "bent" else y
    np.savez(tmp_path / "run.npz", voltage=u, displacement=y, sample_period=record.sample_period)
    done = piezo("recalibrate", identified / "model.yaml", tmp_path / "run.npz", "-o", tmp_path / "new.yaml")
    assert done.status == status
    if column == "micrometres":
        assert "check stage, columns and units" in done.err and done.err.count("\n") == 1
    else:
        verdict = done.out.splitlines()[-1]
        assert verdict.startswith("Verdict: ") and ("doubtful" in verdict) == (column == "clipped")
        assert ("does not describe this stage" in verdict) == bool(status)
        new = model_file.load(tmp_path / "new.yaml").provenance
        old = model_file.load(identified / "model.yaml").provenance
        again = piezo("validate", tmp_path / "new.yaml", tmp_path / "run.npz")
        assert again.status == status, "one criterion for both"
        assert ("does not describe this stage" in again.out.splitlines()[-1]) == bool(status)
        ratio = float(new["free_run_error"]) / float(old["free_run_error"])
        assert ratio < 1.0 if column == "same" else ratio > 3.0, "the file states the real error"
    if column == "same":  # the history before the record is unknown, and hides no gain
        assert float(re.search(r"gain +([+-][0-9.]+) %", done.out)[1]) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize(
    "answer",
    [{"schema": 1, "percent_of_range": 0.1}, {"schema": 1, "verdict": "named", "effects": [{"name": "creep"}]}],
)
def test_report_refuses_what_is_no_answer_of_a_diagnosis(piezo, identified, folder, tmp_path, answer):
    (tmp_path / "answer.json").write_text(json.dumps(answer))
    words = ("--model", identified / "model.yaml", "--answer", tmp_path / "answer.json", "-o", tmp_path / "page.html")
    done = piezo("report", folder, *words)
    assert done.status == 2 and done.err.count("\n") == 1
    assert "answer.json" in done.err and "expected the answer of `piezo diagnose --json`" in done.err


def test_report_refuses_two_models_of_one_name(piezo, identified, folder, tmp_path):
    """The page would compare one model only, and name it twice."""
    for place in ("old", "new"):
        (tmp_path / place).mkdir()
        shutil.copy(f"{identified}/model.yaml", tmp_path / place / "model.yaml")
    words = (word for place in ("old", "new") for word in ("--model", tmp_path / place / "model.yaml"))
    done = piezo("report", folder, *words, "-o", tmp_path / "page.html")
    assert done.status == 2 and "two models called 'model', expected LABEL=FILE" in done.err
    assert not (tmp_path / "page.html").exists()


def test_import_maps_columns_units_and_period_of_a_foreign_file(piezo, tmp_path):
    t = 0.01 * np.arange(400)
    u = 2.0 - 2.0 * np.cos(2 * np.pi * t)
    foreign = tmp_path / "foreign.dat"
    np.savetxt(foreign, np.column_stack((1e3 * u, np.zeros(u.size), 5.0 * u)))
    options = "--column voltage=1 --unit voltage=mV --column displacement=3 --unit displacement=um --sample-period 0.01"
    words = [*options.split(), "--phase", "sine_1hz", "--rows", "100:300", "--json", tmp_path / "i.json"]
    done = piezo("import", foreign, "-o", tmp_path / "ours", *words)
    assert done.status == 0, done.err
    (record,) = recording.read(tmp_path / "ours")
    assert record.voltage == pytest.approx(u[100:300], abs=1e-9)
    assert record.displacement == pytest.approx(5e-6 * u[100:300], abs=1e-14)
    assert (record.sample_period, record.phase) == (0.01, "sine_1hz")
    assert "What was recorded" in done.out
    assert json.loads((tmp_path / "i.json").read_text())["phases"][0]["samples"] == 200


def test_several_recordings_of_one_stage_are_one_experiment(piezo, identified, folder, tmp_path):
    paths = [folder / "04_triangle.npz", folder / "03_noise.npz"]
    assert piezo("validate", identified / "model.yaml", *paths, "--json", tmp_path / "v.json").status == 0
    assert [p["phase"] for p in json.loads((tmp_path / "v.json").read_text())["phases"]] == ["triangle", "noise"]
    assert piezo("import", *paths, "-o", tmp_path / "both").status == 0
    assert [(r.phase, r.continues) for r in recording.read(tmp_path / "both")] == [
        ("triangle", False),
        ("noise", False),
    ]


def test_simulate_is_repeatable_and_hides_the_effect_of_the_seed(piezo, tmp_path):
    for name in ("one", "two"):
        words = ["--protocol", "paper", "--sample-period", "1e-4", "--seed", 7, "--hidden", 3]
        done = piezo("simulate", "-o", tmp_path / name, *words, "--truth", tmp_path / f"{name}.json")
        assert done.status == 0, done.err
        assert re.search(r"largest slew [0-9.]+ V/s", done.out), "shown before anything moves, without an exponent"
    first, second = recording.read(tmp_path / "one"), recording.read(tmp_path / "two")
    assert all(np.array_equal(a.displacement, b.displacement) for a, b in zip(first, second, strict=True))
    truth = json.loads((tmp_path / "one.json").read_text())
    assert truth["name"] in HIDDEN_EFFECTS
    assert truth["name"] not in done.out
    assert [r.continues for r in first] == [False] + [True] * (len(first) - 1)


def test_simulate_takes_the_plant_from_a_file(piezo, tmp_path):
    plant = tmp_path / "plant.yaml"
    plant.write_text("sensor: {noise: 0.0, adc_bits: 0}\nstructure.displacement_scale: 5.0e-5\n")
    for name, options in (("half", ["--plant", plant]), ("whole", ["--noise", "0"])):
        piezo("simulate", "-o", tmp_path / name, "--protocol", "paper", "--sample-period", "1e-4", *options)
    half, whole = (next(r for r in recording.read(tmp_path / n) if r.phase == "triangle") for n in ("half", "whole"))
    assert np.ptp(half.displacement) / np.ptp(whole.displacement) == pytest.approx(0.5, rel=0.01)


def test_json_has_no_number_that_machines_cannot_read(piezo, identified, folder, tmp_path):
    piezo("validate", identified / "model.yaml", folder, "--json", tmp_path / "v.json")
    text = (tmp_path / "v.json").read_text()
    assert "NaN" not in text
    assert "Infinity" not in text


def test_diagnose_reports_effects_that_few_data_cannot_show(piezo, folder, tmp_path):
    part = tmp_path / "part"
    part.mkdir()
    for name in ("01_rest", "02_step", "03_noise", "04_triangle"):
        shutil.copy(folder / f"{name}.npz", part)
    done = piezo("diagnose", part, "--json", tmp_path / "d.json", "-o", tmp_path / "better.yaml")
    assert done.status == 0, "unknown is an answer"
    answer = json.loads((tmp_path / "d.json").read_text())
    assert (answer["schema"], answer["verdict"], answer["effects"]) == (1, "unknown", [])
    assert "do not allow a verdict" in done.out
    assert " ".join(answer["reason"].split())[1:20] in " ".join(done.out.split())
    assert (answer["model"] == "") == (not (tmp_path / "better.yaml").exists())
