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

"""A text table whose writer was ended within a row."""

import pytest

from piezo_hysteresis.recording import read


def rows_of(size: int) -> list[str]:
    """Header and rows of a triangle."""
    rows = (f"{0.001 * k:.3f},{0.1 * (k % 50):.1f},{1e-7 * (k % 50):.3g},triangle" for k in range(size))
    return ["time_s,voltage_V,displacement_m,phase", *rows]


@pytest.mark.parametrize("rest", ["0", "0.050", "0.050,5.", "0.050,5.0,", "0.050,5.0,5e-6", "0.050,5.0,5e-6,tri"])
@pytest.mark.parametrize("rows", [50, 12_000])
def test_a_table_that_ends_within_a_row_is_read_up_to_it(tmp_path, rest: str, rows: int) -> None:
    """A small one was refused with "3 columns without titles" or "the time of one sample"."""
    path = tmp_path / "cut.csv"
    path.write_text("\n".join([*rows_of(rows), rest.replace("0.050", f"{0.001 * rows:.3f}")]))
    experiment = read(path)
    assert [(r.phase, r.size) for r in experiment] == [("triangle", rows)]
    assert experiment.notices[0].kind == "cut"


def test_a_last_row_without_an_end_that_is_whole_is_kept(tmp_path) -> None:
    path = tmp_path / "whole.csv"
    path.write_text("\n".join(rows_of(50)))
    experiment = read(path)
    assert (experiment.size, experiment.notices) == (50, ())
