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

"""A model that the compensation node cannot use is told where a user looks, and nothing is planned with it."""

from types import SimpleNamespace

import numpy as np
import pytest
from std_msgs.msg import String

from piezo_hysteresis.acquisition.sample_block import SampleBlock
from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.errors import ModelError
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.model.model_file import dumps, save
from piezo_hysteresis.nodes.compensation import followed_model

pytestmark = pytest.mark.nodes

PERIOD, SIZE = 2e-5, 5000
DRIVER = SimpleNamespace(sample_period=PERIOD)
MODEL = Model((BoucWen(), Arx(a=[-0.8], b=[0.05])), PERIOD)
WILD = Model((BoucWen(p2=1000.0), Arx(b=[1e6, 1e6, 1e6, 1e6])), PERIOD)
"""A model that diverges on large voltages only."""


@pytest.fixture
def receive(monkeypatch):
    """Calls the node's callback of the topic `model`."""
    callbacks = []
    monkeypatch.setattr(followed_model, "subscribe", lambda node, name, callback: callbacks.append(callback))
    return lambda model: callbacks[0](String(data=dumps(model)))


def followed(path=""):
    """The followed model, and the refusals in the status."""
    refusals = []
    status = SimpleNamespace(refuse=lambda phase, reason: refusals.append((phase, reason)))
    return followed_model.FollowedModel(None, path, status, lambda: False), refusals


def blocks(voltage):
    for begin in range(0, voltage.size, SIZE):
        index = np.arange(begin, begin + SIZE, dtype=np.uint32)
        part = voltage[begin : begin + SIZE]
        yield SampleBlock(
            round(begin * PERIOD * 1e9), PERIOD * np.arange(SIZE), part, 1e-6 * part, index, np.ones(SIZE, np.uint32)
        )


def voltages(count):
    """Long and small, at the end large."""
    wave = 1.0 - np.cos(2 * np.pi * 50.0 * PERIOD * np.arange(count))
    return np.where(np.arange(count) < 0.9 * count, 0.01, 3.5) * wave


@pytest.mark.parametrize("has_another", [False, True])
def test_a_model_that_diverges_late_on_the_applied_voltages(receive, tmp_path, has_another):
    model, refusals = followed(str(save(MODEL, tmp_path / "model.yaml")) if has_another else "")
    *before, last, after = blocks(voltages(200_000))
    for block in [*before, last]:
        model.take(block, DRIVER)
    receive(WILD)
    for _ in range(4):  # its run over the history ends in a later block
        model.take(after, DRIVER)
    ((phase, reason),) = refusals
    assert phase == "model" and "diverged" in reason
    assert reason.endswith("the model before it stays in use") == has_another
    if has_another:
        assert dumps(model.ready(DRIVER).model) == dumps(MODEL)
    else:
        with pytest.raises(ModelError, match="refused on the voltages that were applied: simulation diverged"):
            model.ready(DRIVER)


def test_a_model_that_diverges_while_it_is_in_use_is_told_once(receive, tmp_path):
    model, refusals = followed(str(save(WILD, tmp_path / "model.yaml")))
    for block in blocks(voltages(50_000)):
        model.take(block, DRIVER)
    assert [phase for phase, _ in refusals] == ["model"]
    with pytest.raises(ModelError, match="identify again"):
        model.ready(DRIVER)


def test_a_model_of_another_period_is_told_with_the_first_samples(receive, tmp_path):
    slow = Model((BoucWen(), Arx(b=[1.0])), 1e-3)
    model, refusals = followed(str(save(slow, tmp_path / "model.yaml")))
    for block in blocks(voltages(10_000)):
        model.take(block, DRIVER)
    ((phase, reason),) = refusals
    assert phase == "model" and "expected 2e-05 s (the driver's)" in reason
