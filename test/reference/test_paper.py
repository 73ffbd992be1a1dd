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
