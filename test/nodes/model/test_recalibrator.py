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

"""A recalibration that fails leaves everything as it was, says why, and does not keep the next one from its turn."""

import errno

import pytest
from std_srvs.srv import Trigger

from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.model.model_file import dumps
from piezo_hysteresis.nodes.messages.conversions import values_of
from piezo_hysteresis.nodes.model import recalibrator
from piezo_hysteresis.nodes.model.recalibration_job import RecalibrationOutcome
from piezo_hysteresis.nodes.model.recalibrator import Recalibrator
from piezo_hysteresis.online import model_swap

from .changed_stage import MODEL, PERIOD, ChangedStage

pytestmark = pytest.mark.nodes

WILD = Model((BoucWen(p2=1000.0), Arx(b=[1e6, 1e6])), PERIOD)
"""Bounded while the stage is at rest, and beyond all bounds when it moves."""


class FoundWild:
    """A fit that has found a model that diverges."""

    def __init__(self, *_):
        pass

    def poll(self):
        return RecalibrationOutcome(dumps(WILD), "gain", "recalibrated", offset=0.0, numbers=())

    def close(self):
        pass


def raises(error):
    def fail(*_):
        raise error

    return fail


@pytest.fixture
def stage(lab, tmp_path):
    stage = ChangedStage(lab, tmp_path)
    stage.followers.append(Recalibrator(stage.node, stage.reporter, lambda *new: stage.predictor.swap(*new)))
    stage.play(8.0)
    return stage


def refusal(lab, stage):
    """Why the recalibration failed; the next one can be asked for."""
    assert lab.call(Trigger, "model_node/recalibrate").success

    def refused():
        stage.play(0.1)
        text = values_of(stage.published[-1]).get("recalibration", "")
        return text.startswith("refused: ") and text

    text = lab.wait(refused, "a refusal")
    assert lab.call(Trigger, "model_node/plan_recalibration").success
    return text


@pytest.mark.parametrize("piece", [model_swap.PIECE, 50])
def test_a_recalibrated_model_that_diverges_is_not_kept(lab, stage, tmp_path, monkeypatch, piece):
    """It diverges at once, or, after a long history, in a later block."""
    monkeypatch.setattr(recalibrator, "FitProcess", FoundWild)
    monkeypatch.setattr(model_swap, "PIECE", piece)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*.*")}
    assert "diverge" in refusal(lab, stage)
    assert {path: path.read_bytes() for path in tmp_path.rglob("*.*")} == before
    assert stage.predictor.newest_model is stage.predictor.model is MODEL
    assert stage.reporter.watch.since, "the alarm of the present model"
    assert stage.node.faults == 0


@pytest.mark.parametrize(
    ("part", "error", "reason"),
    [
        ("FitProcess", OSError(errno.EAGAIN, "Resource temporarily unavailable"), "Resource temporarily unavailable"),
        ("write_task", MemoryError("1 GB"), "1 GB"),
        ("write_task", OSError(errno.ENOSPC, "No space left on device"), "is the disk full?"),
    ],
)
def test_a_fit_that_cannot_run_is_reported_once(lab, stage, monkeypatch, part, error, reason):
    """It was raised ten times a second, and every further recalibration was refused until the node was restarted."""
    monkeypatch.setattr(recalibrator, part, raises(error))
    assert reason in refusal(lab, stage)
    stage.play(1.0)
    lab.pause(0.5)
    assert stage.node.faults <= 1
