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

"""The files in config/ give every parameter of a node its default, no more and no fewer."""

from pathlib import Path

import pytest

from piezo_hysteresis.acquisition.settings import DRIVER
from piezo_hysteresis.errors import ParameterError
from piezo_hysteresis.model.parameter_file import parameters
from piezo_hysteresis.nodes.identification.settings import IDENTIFICATION
from piezo_hysteresis.nodes.model.model_node import MODEL
from piezo_hysteresis.nodes.runtime.parameters import describe
from piezo_hysteresis.parameter import Setting
from piezo_hysteresis.stage.back_ends import BACK_ENDS

CONFIG = Path(__file__).parents[3] / "config"

ALL = {
    "driver": DRIVER,
    "model": MODEL,
    "identification": IDENTIFICATION,
    **{word: back_end.rows for word, back_end in BACK_ENDS.items()},
}
NUMBERS = {f"{table}.{row.name}": row for table, rows in ALL.items() for row in rows if isinstance(row, Setting)}
NUMBERS = {name: row for name, row in NUMBERS.items() if row.is_number}


@pytest.mark.parametrize("name", NUMBERS)
def test_numbers_of_something_have_a_range_that_ros_shows_and_python_checks(name):
    row = NUMBERS[name]
    (span,) = describe(row).integer_range
    assert -1 <= span.from_value <= row.value <= span.to_value < 2**32
    assert row.check(span.from_value) == span.from_value
    assert row.check(span.to_value) == span.to_value
    for outside in (span.from_value - 1, span.to_value + 1, True, 1.0):
        with pytest.raises(ParameterError, match=row.name):
            row.check(outside)


@pytest.mark.parametrize(("file", "rows"), [("model.yaml", MODEL), ("identification.yaml", IDENTIFICATION)])
def test_config_files_hold_the_defaults(file, rows):
    text, defaults = (CONFIG / file).read_text(), {row.name: row.value for row in rows}
    (held,) = parameters(text).values()
    assert held == {name: defaults[name] for name in held}
    assert [name for name in defaults if name not in text] == []
