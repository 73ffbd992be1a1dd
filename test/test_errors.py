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

"""An error is one line, whatever texts of others it contains, and in every process."""

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from piezo_hysteresis.cli.main import main
from piezo_hysteresis.errors import (
    DeviceError,
    DivergenceError,
    IdentificationError,
    MissingPackageError,
    PiezoError,
    RecordingError,
    StageError,
    StoppedError,
    UnknownVoltageError,
    printable,
    reason_of,
)
from piezo_hysteresis.record import Notice, Record
from piezo_hysteresis.stage.description import Description

EVIL = "x\x1b]0;title\x07\r\n[ERROR] forged\u202e\x9b2J\x00"


@given(st.text())
def test_any_text_becomes_one_printable_line(text):
    line = printable(text)
    assert line.isprintable()
    assert printable(line) == line
    assert (line == text) == text.isprintable()


@pytest.mark.parametrize("kind", [PiezoError, StageError, RecordingError])
def test_every_error_is_one_printable_line(kind):
    assert str(kind(EVIL)) == printable(EVIL)
    assert reason_of(kind(EVIL)) == printable(EVIL)


@pytest.mark.parametrize(
    "error",
    [
        DivergenceError("arx", 10694, 0.21388),
        MissingPackageError("fleet", "dask", "fleet"),
        *(kind("said") for kind in (PiezoError, IdentificationError, StageError, DeviceError)),
        *(kind("said") for kind in (StoppedError, UnknownVoltageError)),
    ],
    ids=lambda error: type(error).__name__,
)
def test_an_error_says_the_same_after_its_way_from_a_helper_process(error):
    arrived = pickle.loads(pickle.dumps(error))
    assert type(arrived) is type(error)
    assert str(arrived) == str(error)
    assert vars(arrived) == vars(error)


def test_other_exceptions_are_faults_of_the_program_in_one_line():
    assert reason_of(KeyError(EVIL)).startswith("fault of this program: KeyError(")
    assert reason_of(UnicodeError(EVIL)).isprintable()


def test_names_from_files_and_devices_are_printable():
    assert Record([0.0, 1.0], [0.0, 1.0], 1.0, phase=EVIL).phase == printable(EVIL)
    assert Notice("gap", EVIL).message == printable(EVIL)
    assert Description(EVIL, True, 1.0, 1.0, 0.0, 1.0).name == printable(EVIL)


@pytest.mark.parametrize("where", ["titles", "phases", "cells"])
def test_a_table_of_others_steers_no_terminal(tmp_path, capfd, where):
    evil = "x\x1b]0;title\x07\u202e\x9b2J"
    titles = f"time_s,voltage_V,displacement_m,phase,{evil if where == 'titles' else 'more'}"
    time = 1e-3 * np.arange(200)
    rows = [
        f"{t:.6f},{np.sin(9 * t):.6f},{1e-6 * np.sin(9 * t):.9e},{evil if where == 'phases' else 'p'},1" for t in time
    ]
    if where == "cells":
        rows[100] = f"{time[100]:.6f},{evil},1e-6,p,1"
    table = tmp_path / "foreign.csv"
    table.write_text("\n".join((titles, *rows)) + "\n")
    main(["import", str(table), "-o", str(tmp_path / "out")])
    main(["import", str(table), "-o", str(tmp_path / "out2"), "--column", "displacement=absent"])
    main(["identify", str(tmp_path / "out"), "-o", str(tmp_path / "model.yaml")])
    said = capfd.readouterr()
    for stream in said:
        assert all(line.isprintable() for line in stream.split("\n")), stream
    assert said.out + said.err
