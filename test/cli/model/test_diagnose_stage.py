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

"""``piezo diagnose --stage``: the gap finder drives a simulated stage until it is sure."""

import json

import pytest

from piezo_hysteresis import recording

pytestmark = pytest.mark.device

STAGE = """
/**:
  ros__parameters:
    stage: simulated
    sample_period: 1.0e-4
    real_time_factor: 1000.0
    block_duration: 0.1
    simulated: {seed: 3, environment: {hum: 2.0e-7}}
"""


def test_a_stage_is_diagnosed_while_it_is_driven(piezo, tmp_path):
    plant, folder, answer, page = (tmp_path / name for name in ("plant.yaml", "experiment", "a.json", "page.html"))
    plant.write_text(STAGE)
    done = piezo("diagnose", "--stage", plant, "-o", folder, "--json", answer, "--report", page)
    assert done.status == 0, done.err
    assert done.out.index("largest slew") < done.out.index("mains_hum"), "the plan is shown before anything moves"
    found = json.loads(answer.read_text())
    assert [e["name"] for e in found["effects"]] == ["mains_hum"]
    live = found["live"]
    assert live["end"] == "sure"
    for update in live["probabilities"]:
        assert sum(update["probabilities"].values()) == pytest.approx(1.0)
    experiment = recording.read(folder)
    assert sum(r.duration for r in experiment) == pytest.approx(live["stage_time_s"], rel=0.01)
    assert all(r.continues for r in experiment.records[1:])
    times = [r.start_time for r in experiment]
    assert times == sorted(times)
    assert "Probability of each explanation" in page.read_text()
    assert (tmp_path / "page_figures" / "probabilities.csv").exists()


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ((), "got no recording, expected one or several, or --stage FILE"),
        (("--stage", "plant.yaml"), "expected the folder of the experiment to write"),
        (("recording", "--error-rate", "0.01"), "without --stage"),
        (("recording", "--stage", "plant.yaml", "-o", "out"), "expected --stage alone"),
        (("--stage", "plant.yaml", "-o", "out", "--error-rate", "0.7"), "error rate: got 0.7"),
        (("--stage", "plant.yaml", "-o", "out", "--stage-time", "3"), "stage time: got 3 s"),
    ],
)
def test_invalid_values_are_refused_in_one_line(piezo, tmp_path, monkeypatch, words, reason):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "plant.yaml").write_text("sensor.noise: 2.0e-4\n")
    done = piezo("diagnose", *words)
    assert done.status == 2
    assert reason in done.err
    assert done.err.count("\n") == 1
    assert not (tmp_path / "out").exists()
