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

"""What goes wrong on a first day, as it is typed: real `piezo` processes on files as instruments write them."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

from piezo_hysteresis import recording
from piezo_hysteresis.cli import terminal
from piezo_hysteresis.stage.simulated import SimulatedStage

from ..piezo_command import piezo

README = Path(__file__).parents[2] / "README.md"
TIME = np.arange(400) * 5e-3
VOLTAGE = 1.8 - 1.8 * np.cos(2 * np.pi * TIME)
MICRONS = 12.0 * VOLTAGE


def refused(*words):
    """One line and status 2; returns the line."""
    done = piezo(*words)
    assert done.returncode == 2, done.stdout + done.stderr
    (line,) = done.stderr.splitlines()
    return line


def table(path, head, rows=None, delimiter=","):
    rows = np.column_stack((TIME, VOLTAGE, MICRONS)) if rows is None else rows
    lines = (delimiter.join(f"{x:.6f}" for x in row) for row in rows.tolist())
    path.write_text(head + "\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.fixture
def plain(tmp_path):
    return table(tmp_path / "plain.csv", "time_s,voltage_V,displacement_um\n")


@pytest.mark.parametrize("factor", [0.1, 10.0])
def test_a_sample_period_that_contradicts_the_times_is_refused(tmp_path, plain, factor):
    line = refused("import", plain, "-o", tmp_path / "out", "--sample-period", 5e-3 * factor)
    assert f"--sample-period: got {5e-3 * factor:g} s, but the times of the file are 0.005 s apart" in line
    assert "--unit" in line
    assert not (tmp_path / "out").exists()
    done = piezo("import", plain, "-o", tmp_path / "out", "--sample-period", 5e-3)
    assert done.returncode == 0, done.stderr


def test_so_it_is_in_an_npz_file(tmp_path):
    np.savez(tmp_path / "01_x.npz", time=TIME, voltage=VOLTAGE, displacement=1e-6 * MICRONS)
    assert "0.005 s apart" in refused("import", tmp_path / "01_x.npz", "-o", tmp_path / "o", "--sample-period", "0.05")


def test_a_rate_given_as_a_sample_period_is_refused(tmp_path, plain):
    line = refused("import", plain, "-o", tmp_path / "out", "--sample-period", "100")
    assert "--sample-period: got 100 s" in line
    assert "if 100 Hz is the sample rate, give 0.01" in line


PICOSCOPE = "Time,Channel A,Channel B\n(ms),(V),(mV)\n\n"
KEYSIGHT = "x-axis,1,2\nsecond,Volt,Volt\n"
SEPARATED = "Zeit;Spannung;Weg\n[ms];[V];[µm]\n\n"


def test_titles_and_a_row_of_units_above_an_empty_line(tmp_path):
    rows = np.column_stack((1e3 * TIME, VOLTAGE, 1e3 * VOLTAGE))
    pico = table(tmp_path / "pico.csv", PICOSCOPE, rows)
    assert refused("import", pico, "-o", tmp_path / "out").endswith("e.g. displacement=3")
    words = ["--column", "displacement=Channel B [mV]", "--column", "voltage=2", "--unit", "displacement=1.2e-8"]
    done = piezo("import", pico, "-o", tmp_path / "out", *words, "--phase", "sine_1hz")
    assert done.returncode == 0, done.stderr
    (record,) = recording.read(tmp_path / "out")
    assert record.sample_period == pytest.approx(5e-3)
    np.testing.assert_allclose(record.displacement, 12e-6 * VOLTAGE, atol=1e-11)


def test_ambiguous_columns_are_listed_with_the_option_that_selects_one(tmp_path):
    scope = table(tmp_path / "keysight.csv", KEYSIGHT)
    line = refused("import", scope, "-o", tmp_path / "out")
    assert "1 'x-axis [s]', 2 '1 [V]', 3 '2 [V]'" in line
    assert "name it by --column, e.g. voltage=2" in line
    assert "columns," not in line.split("expected")[1]
    done = piezo("import", scope, "-o", tmp_path / "out", "--column", "voltage=2", "--column", "displacement=3",
                 "--unit", "displacement=1e-6", "--phase", "x")  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert recording.read(tmp_path / "out")[0].sample_period == pytest.approx(5e-3)


def test_units_of_a_row_of_their_own_count(tmp_path):
    rows = np.column_stack((1e3 * TIME, VOLTAGE, MICRONS))
    done = piezo("import", table(tmp_path / "w.csv", SEPARATED, rows, ";"), "-o", tmp_path / "out", "--phase", "x")
    assert done.returncode == 0, done.stderr
    (record,) = recording.read(tmp_path / "out")
    np.testing.assert_allclose(record.displacement, 1e-6 * MICRONS, atol=1e-11)
    assert record.sample_period == pytest.approx(5e-3)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--column", "voltage=7"], "--column: got 7 for voltage"),
        (["--unit", "displacement=inch"], "--unit: got 'inch'"),
        (["--rows", "900:1000"], "--rows: got"),
        (["--average", "0"], "--average: got 0"),
        (["--decimate", "hum=3"], "--decimate: no phase 'hum'"),
        (["--phase", "3=a", "--phase", "1=b"], "--phase: got start times"),
    ],
)
def test_errors_name_the_options_that_were_typed(tmp_path, plain, words, says):
    line = refused("import", plain, "-o", tmp_path / "out", *words)
    assert says in line
    assert "`" not in line


@pytest.mark.parametrize("output", ["folder", "file.csv", "file.mat", "bag.mcap"])
def test_an_output_that_exists_is_refused_before_the_work(tmp_path, plain, output):
    place = tmp_path / output.removesuffix(".mcap")
    if place.suffix:
        place.write_text("mine")
    else:
        place.mkdir()
        (place / "mine.txt").write_text("mine")
    # neither the recording nor the stage is looked at before: these would be refused for another reason
    for words in (["import", tmp_path / "missing.csv"], ["simulate", "--plant", tmp_path / "missing.yaml"]):
        line = refused(*words, "-o", tmp_path / output)
        assert "-o: " in line
        assert "exists already" in line
    assert (place if place.suffix else place / "mine.txt").read_text() == "mine"


def test_an_empty_folder_is_a_place_to_write_to_and_other_files_are_kept_too(tmp_path, plain):
    (tmp_path / "out").mkdir()
    assert piezo("import", plain, "-o", tmp_path / "out").returncode == 0
    (tmp_path / "answer.json").write_text("mine")
    assert "--json: " in refused("import", plain, "-o", tmp_path / "two", "--json", tmp_path / "answer.json")
    assert "--truth: " in refused("simulate", "-o", tmp_path / "three", "--truth", tmp_path / "answer.json")
    assert (tmp_path / "answer.json").read_text() == "mine"


def test_preview_shows_what_was_understood_and_writes_no_experiment(tmp_path, plain):
    picture = tmp_path / "look.png"
    done = piezo("import", plain, "--preview", picture)
    assert done.returncode == 0, done.stderr
    assert "What was understood" in done.stdout
    rows = {line.split()[0]: line for line in done.stdout.splitlines() if line.startswith(("voltage", "displacement"))}
    assert "0 … 3.6 V" in rows["voltage"]
    assert "0 … 43.2 µm" in rows["displacement"]
    assert "sine_1hz" in done.stdout
    assert f"wrote the picture {picture}" in done.stdout
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["look.png", "plain.csv"]


def test_preview_replaces_no_file_and_without_it_an_output_is_needed(tmp_path, plain):
    (tmp_path / "look.png").write_text("mine")
    assert "--preview: " in refused("import", plain, "--preview", tmp_path / "look.png")
    assert (tmp_path / "look.png").read_text() == "mine"
    assert "-o" in refused("import", plain)
    done = piezo("import", plain, "--preview", tmp_path / "other.svg", "-o", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "other.svg").read_text().lstrip().startswith("<?xml")
    assert len(recording.read(tmp_path / "out")) == 1


def test_results_never_replace_a_file_without_force(tmp_path, plain):
    (tmp_path / "model.yaml").write_text("mine")
    for command, option in (
        (("identify", plain, "-o"), "-o"),
        (("identify", plain, "--json"), "--json"),
        (("diagnose", plain, "-o"), "-o"),
        (("diagnose", plain, "--report"), "--report"),
        (("report", plain, "-o"), "-o"),
        (("validate", tmp_path / "absent.yaml", plain, "--json"), "--json"),
        (("compensate", tmp_path / "absent.yaml", plain, "--report"), "--report"),
    ):
        line = refused(*command, tmp_path / "model.yaml")
        assert f"{option}: {tmp_path}/model.yaml exists already" in line
        assert "give --force to replace it" in line
    assert (tmp_path / "model.yaml").read_text() == "mine"
    figures = tmp_path / "figures"
    figures.mkdir()
    (figures / "mine.png").touch()
    assert "holds files already" in refused("validate", tmp_path / "m.yaml", plain, "--figures", figures)


def test_the_verdict_is_the_last_line_and_force_replaces(tmp_path, plain):
    (tmp_path / "model.yaml").write_text("mine")
    done = piezo("identify", plain, "-o", tmp_path / "model.yaml", "--force")
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1].startswith("Verdict: The model describes this stage")
    assert "identify: 400 samples; this usually takes" in done.stderr
    assert (tmp_path / "model.yaml").read_text() != "mine"
    rows = np.column_stack((TIME, VOLTAGE, -40.0 * np.cos(2 * np.pi * 7 * TIME)))
    other = table(tmp_path / "other.csv", "time_s,voltage_V,displacement_um\n", rows)
    done = piezo("validate", tmp_path / "model.yaml", other)
    assert done.stdout.splitlines()[-1].startswith("Verdict: The model does not describe this stage: its error is ")


def test_a_verdict_states_how_far_the_error_is_above_the_noise(tmp_path, plain):
    """A lag of 10 ms more is 2 % of the range at 1 Hz: a model with this error does not describe all of the stage."""
    noise = np.random.default_rng(1).normal(size=TIME.size) * 0.01
    for name, shift in (("same", 0), ("late", 2)):
        rows = np.column_stack((TIME, VOLTAGE, np.interp(TIME - 5e-3 * shift, TIME, MICRONS) + noise))
        table(tmp_path / f"{name}.csv", "time_s,voltage_V,displacement_um\n", rows)
    piezo("identify", tmp_path / "same.csv", "-o", tmp_path / "model.yaml")
    said = {
        n: piezo("validate", tmp_path / "model.yaml", tmp_path / f"{n}.csv").stdout.splitlines()[-1]
        for n in ("same", "late")
    }
    assert "This error is at the noise floor." in said["same"]
    assert "times its noise floor" in said["late"]


def test_an_undetermined_fit_is_reported_with_status_1(tmp_path):
    from types import SimpleNamespace

    from piezo_hysteresis.cli.model.identify import verdict_line

    fit = SimpleNamespace(converged=False, iterations=40, at_bounds=())
    said = verdict_line(SimpleNamespace(fit=fit, free_run_percent=5.0, notices=()))
    assert said.startswith("Verdict: not determined. The fit stopped after 40 linearisations, before it had converged")


def test_a_parameter_at_a_bound_has_no_interval_and_the_result_counts(tmp_path):
    """It was called undetermined, beside status 0; README and help state status 1 only if nothing can be trusted."""
    from types import SimpleNamespace

    from piezo_hysteresis.cli.model.identify import verdict_line

    model = SimpleNamespace(row=lambda name: SimpleNamespace(off=None))
    fit = SimpleNamespace(converged=True, at_bounds=("arx.delay",), model=model, values={"arx.delay": 0.0})
    said = verdict_line(SimpleNamespace(fit=fit, free_run_percent=0.3, notices=(), phases=()))
    assert said.endswith("At a bound of the range, and therefore without an interval: arx.delay.")
    for text in (piezo("--help").stdout, README.read_text(encoding="utf-8")):
        assert "1 if the result cannot be trusted" in " ".join(text.split())


def test_swapped_channels_are_found(tmp_path):
    stage = SimulatedStage(seed=1, sample_period=1e-3)
    drive = np.concatenate((np.zeros(500), 5 - 5 * np.cos(2 * np.pi * 2 * np.arange(3000) * 1e-3)))
    record = stage.play(drive, "x")
    swapped = np.column_stack((record.time, record.displacement * 2e5, record.voltage * 5))
    done = piezo(
        "import", table(tmp_path / "s.csv", "time_s,voltage_V,displacement_um\n", swapped), "-o", tmp_path / "o"
    )
    (line,) = (line for line in done.stdout.splitlines() if line.startswith("leads"))
    assert "both are swapped" in done.stdout
    assert "severe" in line
    assert done.stdout.splitlines()[-1] == "Severe findings above: check the recording before you use it."
    assert done.returncode == 1


def test_three_phases_in_one_file_become_three(tmp_path):
    t = np.arange(3000) * 1e-3
    rest = np.zeros(500)
    ramp = np.interp(t % 1, [0, 0.5, 1], [0, 8, 0])
    drive = np.concatenate((rest, 5 - 5 * np.cos(4 * np.pi * t), rest, ramp, rest, np.repeat([0.0, 3, 6, 3, 0], 600)))
    noise = np.random.default_rng(0).normal(scale=0.01, size=drive.size)
    rows = np.column_stack((np.arange(drive.size) * 1e-3, drive, 5.0 * drive + noise))
    path = table(tmp_path / "three.csv", "time_s,voltage_V,displacement_um\n", rows)
    done = piezo("import", path, "-o", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    names = [r.phase for r in recording.read(tmp_path / "out") if r.phase != "rest"]
    assert names == ["sine_2hz", "triangle", "staircase"]


def test_so_do_three_waveforms_without_rests(tmp_path):
    t = np.arange(4000) * 1e-3
    drive = np.concatenate(
        (5 - 5 * np.cos(4 * np.pi * t), np.interp(t % 1, [0, 0.5, 1], [0, 8, 0]), 4 - 4 * np.cos(40 * np.pi * t))
    )
    rows = np.column_stack((np.arange(drive.size) * 1e-3, drive, 5.0 * drive))
    path = table(tmp_path / "three.csv", "time_s,voltage_V,displacement_um\n", rows)
    done = piezo("import", path, "-o", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    records = recording.read(tmp_path / "out").records
    assert [(r.phase, r.continues) for r in records] == [("sine_2hz", False), ("triangle", True), ("sine_20hz", True)]
    assert "sine_2hz from 0 s, triangle from 4 s, sine_20hz from 8 s" in done.stdout


def test_help_of_emulate_names_the_ports():
    said = " ".join(piezo("emulate", "--help").stdout.split())
    assert "default: 50000 for gcs2, 31763 for nidaqmx" in said
    assert "{'" not in said


def test_progress_without_a_terminal_is_a_line_now_and_then(capsys, monkeypatch):
    monkeypatch.setattr(terminal, "LINE_INTERVAL", 0.02)
    with terminal.progress("identify", "this usually takes a while") as report_progress:
        report_progress("dynamics", 0.25)
        while "dynamics" not in (said := capsys.readouterr().err):
            time.sleep(0.01)
            report_progress("dynamics", 0.25)
    assert "identify: dynamics, 25 %, 0 s" in said
