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

"""The paper from its own figures; what each number means stands in the script that makes it."""

import pytest


def test_table_1_row_of_mbw_alone_follows_from_the_published_coefficients(exhibit):
    numbers = exhibit("table_1")
    assert numbers["lag of G [% of peak-to-peak]"] == pytest.approx([0.02, 1.13, 2.25, 4.51, 6.76, 9.00], abs=0.006)


def test_table_1_lag_and_dynamic_row_in_quadrature_are_the_published_row(exhibit):
    assert exhibit("table_1")["largest departure from the published row [%]"] < 10.0


def test_figure_1_classical_loop_is_symmetric_and_the_cubic_alone_makes_it_asymmetric(exhibit):
    numbers = exhibit("figure_1")
    assert numbers["asymmetry of CBW [% of height]"] < 1e-9
    assert numbers["asymmetry of MBW [% of height]"] > 1.0
    assert numbers["MBW - CBW - p1 v^3, largest [1]"] < 1e-12


def test_figure_5_arx_follows_the_measured_response_and_absorbs_hysteresis(exhibit):
    numbers = exhibit("figure_5")
    assert numbers["ARX over measured, rms [dB]"] < 0.2
    assert numbers["ARX minus measured, rms [degree]"] < 1.0
    # noise lets the Bouc-Wen state forget: between the slopes p2 + A and p2, which are 1.54 apart
    assert 1.2 < numbers["dc gain of this ARX over K (p2 + A) of the stage [1]"] < 1.6


def test_figure_6_triangle_is_fitted_to_less_than_the_paper_reached(exhibit):
    numbers = exhibit("figure_6")
    assert numbers["MBW fit, Bouc-Wen stage [% of peak-to-peak]"] < 0.05
    assert numbers["MBW fit, Prandtl-Ishlinskii stage [% of peak-to-peak]"] < 0.73


def test_figure_7_dynamic_model_reaches_the_noise_at_every_frequency(exhibit):
    numbers = exhibit("figure_7")
    row = numbers["dynamic model, joint fit [% of peak-to-peak]"]
    assert max(row) < 1.25 * numbers["sensor noise [% of peak-to-peak]"]
    assert all(a < b for a, b in zip(row, numbers["dynamic model, paper [%]"], strict=True))


def test_figure_7_the_three_steps_alone_grow_with_frequency_as_the_paper_does(exhibit):
    row = exhibit("figure_7")["dynamic model, three steps alone [% of peak-to-peak]"]
    assert row == sorted(row)
    assert row[-1] > 1.0


@pytest.mark.parametrize(("stage", "reached"), [("Bouc-Wen", 0.10), ("Prandtl-Ishlinskii", 0.75)])
def test_table_1_on_a_stage_with_nothing_hidden(exhibit, stage, reached):
    numbers = exhibit("table_1_stages")
    dynamic = numbers[f"{stage} stage, dynamic model [% of range]"]
    alone = numbers[f"{stage} stage, MBW alone [% of range]"]
    assert max(dynamic) <= reached
    assert alone == sorted(alone)
    assert alone[-1] > 1.0
    assert all(d < a for d, a in zip(dynamic, alone, strict=True))


def test_figure_8_mbw_alone_on_the_stage_is_the_row_that_the_coefficients_predict(exhibit):
    numbers = exhibit("figure_8")
    assert numbers["MBW alone, simulated stage [% of peak-to-peak]"] == pytest.approx(
        numbers["lag of the published G [% of peak-to-peak]"], rel=0.02, abs=0.06
    )


def test_figure_9_triangle_of_100_hz(exhibit):
    numbers = exhibit("figure_9")
    assert numbers["dynamic model [% of peak-to-peak]"] < 0.2
    assert numbers["MBW alone [% of peak-to-peak]"] > 1.5
