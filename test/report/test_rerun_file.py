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

"""The file for the Rerun viewer, read back by Rerun's own reader."""

import numpy as np
import pytest

from piezo_hysteresis.cli.main import main
from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.report.figures.comparison import compare
from piezo_hysteresis.report.rerun_file import write_rerun

chunk = pytest.importorskip("rerun.chunk", reason="no rerun-sdk here; scripts/setup-checks installs it")

PERIOD = 1e-3
MODEL = Model((BoucWen(), Arx(a=(-0.6,), b=(0.2,))), PERIOD, displacement_scale=1e-5)


@pytest.fixture(scope="module")
def experiment():
    time = PERIOD * np.arange(1000)
    records = []
    for k, amplitude in enumerate((1.0, 3.0)):
        voltage = amplitude * (1.0 - np.cos(2 * np.pi * 5.0 * time))
        measured = MODEL.run(voltage, MODEL.rest(0.0))[0] + 1e-9 * np.random.default_rng(k).standard_normal(time.size)
        records.append(Record(voltage, measured, PERIOD, f"sine_{k}", start_time=2.0 * k))
    return Experiment(tuple(records))


def columns(reader, timeline="time"):
    """Values of every component with its times [s], by entity and component."""
    found = {}
    for part in reader.stream().to_chunks():
        batch = part.to_record_batch()
        names = batch.schema.names
        times = batch.column(timeline).cast("int64").to_numpy() * 1e-9 if timeline in names else None
        for name in names:
            found.setdefault(f"{part.entity_path} {name.rpartition(':')[2]}", []).append((times, batch.column(name)))
    return found


def values(found, name):
    pairs = [(t, np.array([row[0] for row in column.to_pylist()])) for t, column in found[name]]
    time, value = np.concatenate([t for t, _ in pairs]), np.concatenate([v for _, v in pairs])
    order = np.argsort(time)
    return time[order], value[order]


def test_the_file_contains_samples_phases_loops_spectra_and_a_blueprint(experiment, tmp_path):
    path = tmp_path / "experiment.rrd"
    comparison = compare(experiment, {"model": MODEL})
    write_rerun(comparison, path, "two sines")
    reader = chunk.RrdReader(path)
    assert len(reader.recordings()) == len(reader.blueprints()) == 1
    found = columns(reader)
    time, measured = values(found, "/displacement/measured scalars")
    expected = np.concatenate([r.displacement for r in experiment])
    np.testing.assert_allclose(time, np.concatenate([r.start_time + PERIOD * np.arange(r.size) for r in experiment]))
    np.testing.assert_allclose(measured, 1e6 * expected)
    _, residual = values(found, "/residual scalars")
    predicted = np.concatenate(comparison.now.predicted)
    np.testing.assert_allclose(residual, 1e9 * (expected - predicted), atol=1e-6)
    start, phase = values(found, "/phase state")
    assert list(start) == [0.0, 2.0]
    assert list(phase) == ["1 sine_0", "2 sine_1"]
    for name in ("/loop/measured positions", "/loop/predicted positions"):
        points = np.concatenate([np.array(row) for _, column in found[name] for row in column.to_pylist()])
        assert points[:, 0].min() == pytest.approx(0.0, abs=1e-3)
        assert points[:, 0].max() == pytest.approx(100.0, abs=1e-3)
    assert "/spectrum/residual values" in found


def test_without_a_model_the_file_contains_no_prediction(experiment, tmp_path):
    path = tmp_path / "bare.rrd"
    write_rerun(compare(experiment), path, "bare")
    found = columns(chunk.RrdReader(path))
    assert "/displacement/measured scalars" in found
    assert not [name for name in found if "predicted" in name or "residual" in name]


def test_the_command_does_not_replace_an_existing_file(tmp_path, capsys):
    path = tmp_path / "kept.rrd"
    path.write_bytes(b"kept")
    assert main(["view", str(tmp_path), "--rerun", str(path)]) == 2
    assert path.read_bytes() == b"kept"
    assert "--force" in capsys.readouterr().err
