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

"""Every recording gets exactly one row, whatever happens to it or to the workers; the rest is kept."""

from __future__ import annotations

import os
import random
import shutil
import signal
import threading
from collections import Counter

import numpy as np
import pytest

pytest.importorskip("distributed")
pytest.importorskip("pyarrow")

from benchmarks.fleet_work import Wait
from piezo_hysteresis import recording
from piezo_hysteresis.cli.model.identify import answer
from piezo_hysteresis.fleet import code_hash, fleet
from piezo_hysteresis.fleet.attempt import OtherCodeError
from piezo_hysteresis.fleet.cluster import cluster
from piezo_hysteresis.fleet.finding import find_recordings
from piezo_hysteresis.fleet.fleet import open_orders, run_fleet
from piezo_hysteresis.fleet.table.results import Results, read_results
from piezo_hysteresis.fleet.work import Identify, Validate
from piezo_hysteresis.identification.identify import identify
from piezo_hysteresis.record import Experiment
from piezo_hysteresis.stage.simulated import SimulatedStage

from .conftest import play


@pytest.fixture
def run(client, tmp_path):
    """Work on a folder; the counts by status."""

    def go(folder, work, **options):
        with Results(tmp_path / "results") as results:
            orders = open_orders(find_recordings([str(folder)]), work, results, **options)
            return dict(run_fleet(orders, results, client).counts)

    return go


@pytest.fixture
def rows(tmp_path):
    return lambda: read_results(tmp_path / "results").to_pylist()


def test_every_recording_has_its_row(recordings, model_text, run, rows, tmp_path):
    assert run(recordings, Validate(model_text)) == {"done": 6, "failed": 1}
    found = {row["recording"]: row for row in rows()}
    assert len(found) == 7
    damaged = found.pop(str(recordings / "stage_c" / "2026-11-04.npz"))
    assert "2026-11-04.npz" in damaged["error"]
    assert damaged["data_hash"].startswith("sha256:")
    for row in found.values():
        assert row["error"] is None
        assert row["samples"] > 500
        assert row["free_run_error_percent"] > 0.0
        assert row["code_hash"] == code_hash.code_hash()
    places = {str(file.relative_to(tmp_path / "results")) for file in tmp_path.rglob("*.parquet")}
    assert places == {f"stage=stage_{s}/month=2026-{m}/rows.parquet" for s in "abc" for m in ("10", "11")}


def test_identified_parameters_have_intervals_and_the_model_loads(recordings, run, rows):
    from piezo_hysteresis.model import model_file

    assert run(recordings / "stage_b" / "2026-10-03", Identify()) == {"done": 1}
    for row in rows():
        model = model_file.loads(row["model"])
        assert row["parameters"]
        for parameter in row["parameters"]:
            assert parameter["lower"] <= parameter["value"] <= parameter["upper"]
            volts, metres = model.row(parameter["name"]).powers
            scale = model.voltage_scale**volts * model.displacement_scale**metres
            scale *= model.sample_period if parameter["name"] == "arx.delay" else 1.0
            assert parameter["value"] == pytest.approx(scale * model.values()[parameter["name"]])


def test_a_value_at_a_bound_has_no_interval_as_in_piezo_identify():
    stage = SimulatedStage.from_mapping({"hysteresis.operator": "prandtl_ishlinskii"}, seed=1, sample_period=1e-3)
    time = 1e-3 * np.arange(4000)
    triangle = (1.0 - np.abs(2.0 * (time % 1.0) - 1.0)) * np.repeat([9.0, 6.0], 2000)
    experiment = Experiment((stage.play(triangle, "triangle"),))
    found = identify(experiment, memory=True)
    assert found.fit.at_bounds
    stated = answer(found, "model.yaml")["parameters"]
    for parameter in Identify()(experiment).parameters:
        without = stated[parameter["name"]]["interval_95"] is None
        assert (parameter["lower"] is None, parameter["upper"] is None) == (without, without)


def test_parameters_of_one_stage_do_not_depend_on_the_amplitude_of_its_recordings():
    time = 1e-3 * np.arange(4000)
    triangle = (1.0 - np.abs(2.0 * (time % 1.0) - 1.0)) * np.repeat([1.0, 0.7], 2000)
    stage = SimulatedStage(seed=3, sample_period=1e-3)
    large, small = (
        {p["name"]: p for p in Identify()(Experiment((stage.play(volts * triangle, "triangle"),))).parameters}
        for volts in (8.0, 5.0)
    )
    assert (large["bouc_wen.beta"]["unit"], large["bouc_wen.p2"]["unit"]) == ("1/V", "m/V")
    for name in ("bouc_wen.A", "bouc_wen.beta", "bouc_wen.p2"):
        assert large[name]["value"] == pytest.approx(small[name]["value"], rel=0.03)
        assert small[name]["lower"] < large[name]["value"] < small[name]["upper"]


def test_only_what_changed_is_computed_again(recordings, model_text, run, rows, monkeypatch):
    work = Validate(model_text)
    run(recordings, work)
    before = {row["recording"]: row for row in rows()}
    assert run(recordings, work) == {}

    changed = recordings / "stage_a" / "2026-10-03"
    shutil.rmtree(changed)
    recording.write(play(77), changed)
    assert run(recordings, work) == {"done": 1}
    after = {row["recording"]: row for row in rows()}
    assert {url for url in after if after[url] != before[url]} == {str(changed)}
    assert after[str(changed)]["data_hash"] != before[str(changed)]["data_hash"]

    for file in changed.iterdir():
        os.utime(file)
    assert run(recordings, work) == {"unchanged": 1}
    assert run(recordings, work) == {}
    assert run(recordings, work, reading={"decimate": {"triangle": 2}}) == {"done": 6, "failed": 1}
    assert len(rows()) == 7


def test_other_code_computes_everything_again(recordings, model_text, client, tmp_path, monkeypatch):
    sources, work = find_recordings([str(recordings)]), Validate(model_text)
    with Results(tmp_path / "results") as results:
        run_fleet(open_orders(sources, work, results), results, client)
        assert open_orders(sources, work, results) == []
        monkeypatch.setattr(fleet, "code_hash", lambda: "sha256:of other code")
        orders = open_orders(sources, work, results)
        assert len(orders) == 7
        with pytest.raises(OtherCodeError, match="install the same version"):
            run_fleet(orders, results, client)


def test_workers_of_a_scheduler_elsewhere(recordings, client, rows, tmp_path):
    """By its address alone, as `--scheduler` gives it; workers and scheduler go on afterwards."""
    sources = find_recordings([str(recordings)])
    with cluster(client.scheduler.address) as guest, Results(tmp_path / "results") as results:
        assert guest.cluster is None
        assert run_fleet(open_orders(sources, Wait(0.0), results), results, guest).counts == {"done": 6, "failed": 1}
    assert len(rows()) == 7
    assert client.submit(sum, (1, 2)).result(timeout=60) == 3


def test_an_interrupted_run_continues(recordings, client, tmp_path):
    sources, work = find_recordings([str(recordings)]), Wait(0.01)

    def stop(word, fraction):
        if fraction > 0.0:
            raise KeyboardInterrupt

    with Results(tmp_path / "results") as results, pytest.raises(KeyboardInterrupt):
        run_fleet(open_orders(sources, work, results), results, client, stop)
    with Results(tmp_path / "results") as results:
        left = open_orders(sources, work, results)
        assert len(left) < 7
        run_fleet(left, results, client)
    urls = [row["recording"] for row in read_results(tmp_path / "results").to_pylist()]
    assert sorted(urls) == [source.url for source in sources]


def test_the_time_limit_costs_one_row(recordings, run, rows):
    shutil.rmtree(recordings / "stage_b")
    assert run(recordings / "stage_a", Wait(60.0), limit=0.5) == {"timed_out": 2}
    assert all("the time limit of 0.5 s" in row["error"] for row in rows())
    assert run(recordings / "stage_a", Wait(60.0), limit=0.5) == {}
    assert run(recordings / "stage_a", Wait(60.0), limit=0.6) == {"timed_out": 2}
    assert run(recordings / "stage_a", Wait(60.0), limit=0.6, retry=True) == {"timed_out": 2}
    assert len(rows()) == 2


def test_a_recording_that_ends_its_process_costs_one_row(recordings, run, rows):
    recording.write(play(5, "crash"), recordings / "stage_b" / "2026-12-01")
    assert run(recordings / "stage_b", Wait(0.01)) == {"done": 2, "killed": 1}
    (lost,) = [row for row in rows() if row["status"] == "killed"]
    assert lost["recording"].endswith("2026-12-01")
    assert "ended in every attempt" in lost["error"]


def test_a_process_that_the_time_limit_ends_is_not_tried_again(recordings, run, rows):
    recording.write(play(5, "stuck"), recordings / "stage_b" / "2026-12-01")
    assert run(recordings / "stage_b", Wait(20.0), limit=3.0) == {"timed_out": 3}
    assert all("the time limit of 3 s" in row["error"] for row in rows())
    assert [row["recording"][-5:] for row in rows() if "its process was ended" in row["error"]] == ["12-01"]


def test_no_row_is_lost_or_doubled_when_workers_are_killed(tmp_path, client):
    file = tmp_path / "template.npz"
    recording.write(play(1), tmp_path / "one")
    (tmp_path / "one" / "01_triangle.npz").rename(file)
    folder = tmp_path / "many"
    for i in range(24):
        (folder / f"s{i % 4}").mkdir(parents=True, exist_ok=True)
        shutil.copy(file, folder / f"s{i % 4}" / f"r{i:02d}.npz")
    sources = find_recordings([str(folder)])
    assert len(sources) == 24
    over, killed, chance = threading.Event(), Counter(), random.Random(3)

    def kill() -> None:
        while not over.wait(chance.uniform(0.5, 1.5)):
            pids = list(client.run(os.getpid, on_error="ignore").values())
            if pids and sum(killed.values()) < 4:
                victim = chance.choice(pids)
                os.kill(victim, signal.SIGKILL)
                killed[victim] += 1

    killer = threading.Thread(target=kill, daemon=True)
    with Results(tmp_path / "results") as results:
        killer.start()
        try:
            summary = run_fleet(open_orders(sources, Wait(0.3), results), results, client)
        finally:
            over.set()
            killer.join()
    assert sum(killed.values()) >= 2
    assert summary.counts == {"done": 24}
    urls = [row["recording"] for row in read_results(tmp_path / "results").to_pylist()]
    assert sorted(urls) == [source.url for source in sources]
