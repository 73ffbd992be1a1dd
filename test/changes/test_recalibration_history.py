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

"""The history of recalibrations: what is written comes back, grows, and is drawn; what is no history is refused."""

from dataclasses import replace

import numpy as np
import pytest

from piezo_hysteresis.changes.group_fit import GroupFit
from piezo_hysteresis.changes.moved_group import changed_by
from piezo_hysteresis.changes.recalibration_history import (
    FILE,
    RecalibratedNumber,
    Recalibrations,
    numbers_of,
    read_numbers,
    write_numbers,
)
from piezo_hysteresis.cli.main import main
from piezo_hysteresis.effects import Arx, BoucWen, ExtraDelay
from piezo_hysteresis.errors import RecordingError
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.report.recalibrations import recalibrations

GAIN = RecalibratedNumber(
    "2026-11-20T10:00:00Z", "gain", "displacement_scale", "m", 1e-5, 1.02e-5, 1.019e-5, 1.021e-5, 7.5,
    2e-8, 2e-9, 1.9e-9, 30.0, "sha256:1", "sha256:2",
)  # fmt: skip
LAG = replace(
    GAIN, time="2026-11-21T10:00:00Z", group="dynamics", parameter="arx.delay", unit="samples", old=1.0, new=1.5
)


def test_the_table_is_extended_in_its_file_and_read_back(tmp_path):
    Recalibrations(tmp_path / "axis").add([GAIN])
    history = Recalibrations(tmp_path / "axis")
    history.add([LAG])
    assert Recalibrations(tmp_path / "axis").numbers == (GAIN, LAG)
    assert len((tmp_path / "axis" / FILE).read_text().splitlines()) == 3


@pytest.mark.parametrize("text", ["", "time,group\n", write_numbers([GAIN]).replace("1.02e-05", "nan"), "\x00"])
def test_an_invalid_history_is_refused_in_one_line(text):
    with pytest.raises(RecordingError, match="expected") as refused:
        read_numbers(text, "a file")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("extra", [(), (ExtraDelay(tau=1e-5),)])
def test_the_lag_of_the_history_is_that_of_the_new_model(extra):
    """A model with both delays got an earlier one in its dynamics, and the history said a negative extra delay."""
    old, change = Model((BoucWen(), Arx(b=[0.3], delay=4.0), *extra), 2e-5), np.array([0.0, 0.0, -3e-5, 0.0, 0.0])
    fit = GroupFit(changed_by(old, change), 0.0, ("dynamics",), change, 0.1 * np.abs(change), 3e-8, 1e-8, 1e-8, 30.0)
    (row,) = numbers_of(old, 0.0, fit, "2026-11-20T10:00:00Z", 2.0, ("sha256:1", "sha256:2"))
    (now,) = numbers_of(fit.model, 0.0, fit, "2026-11-21T10:00:00Z", 2.0, ("sha256:2", "sha256:3"))
    assert (now.parameter, now.old) == (row.parameter, pytest.approx(row.new))
    assert 0.0 < row.low < row.new < row.high


def test_every_number_has_a_panel_that_begins_with_its_old_value():
    drawing = recalibrations([GAIN, LAG])
    labels = [axis.get_ylabel() for axis in drawing.figure.axes]
    assert labels[:2] == ["displacement_scale [m]", "arx.delay [samples]"]
    assert drawing.figure.axes[0].lines[0].get_ydata().tolist() == [1e-5, 1.02e-5]
    assert "arx.delay from 1 to 1.5" in drawing.alternative


def test_the_command_prints_the_table_and_draws_it(tmp_path, capsys):
    Recalibrations(tmp_path).add([GAIN, LAG])
    assert main(["history", str(tmp_path), "-o", str(tmp_path / "history.png")]) == 0
    assert "displacement_scale" in capsys.readouterr().out
    assert (tmp_path / "history.png").stat().st_size > 10_000
    assert main(["history", str(tmp_path / "none")]) == 2
