"""How numbers are written in print."""

import math

import numpy as np
import pytest
from mesoslip.configuration.units import to_si
from mesoslip.quantities import column, number, percent, scale_for, with_error, with_unit


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (18e-6, "N", "18 µN"),
        (-5e3, "N", "-5 kN"),
        (1e-7, "m/s", "100 nm/s"),
        (1.47e-3, "kg", "1.47 g"),
        (2e6, "kg", "2e6 kg"),
        (97, "N/m", "97 N/m"),
        (2e11, "1/s", "2e11 1/s"),
        (1e-10, "m^2", "1e-10 m^2"),
        (0.0, "m", "0 m"),
        (5e-4, "s", "500 µs"),
        (4000.0, "s", "4000 s"),
        (7200.0, "s", "120 min"),
        (86400.0 * 30, "s", "30 d"),
        (0.25, "1", "0.25"),
        (1e-30, "m", "1e-12 am"),
        (2.5e-18, "m/s", "2.5e-6 pm/s"),
    ],
)
def test_a_number_is_written_in_the_unit_that_suits_it(value, unit, text):
    assert with_unit(value, unit) == text
    if unit != "1":
        assert to_si(text, unit, "") == pytest.approx(value)


@pytest.mark.parametrize(
    ("part", "text"),
    [(0.0211, "2.1 %"), (0.9949, "99 %"), (0.9951, "100 %"), (1.74, "174 %"), (0.0, "0 %")],
)
def test_a_part_is_written_in_percent_without_an_exponent(part, text):
    assert percent(part) == text


@pytest.mark.parametrize("exponent", range(-18, 10))
def test_what_is_shown_has_at_most_three_digits_before_the_point(exponent):
    for factor in (1.0, 3.3, 9.99):
        size = factor * 10.0**exponent
        assert 1 - 1e-6 <= size / scale_for(size, "N").size < 1000


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0123456, "0.01235"),
        (110695.13, "110700"),
        (12345.0, "12345"),
        (3.2e-7, "3.2e-7"),
        (2.5e11, "2.5e11"),
        (0.00099996, "0.001"),
        (-0.0, "0"),
        (math.nan, "-"),
        (-math.inf, "-inf"),
    ],
)
def test_a_number_has_the_digits_that_are_asked_for(value, text):
    assert number(value) == text


@pytest.mark.parametrize(
    ("value", "error", "unit", "text"),
    [
        (0.542043, 0.00025, "1", "0.54204 ± 0.00025"),
        (0.003819, 0.0072, "1", "0.0038 ± 0.0072"),
        (-1e-9, 0.0072, "1", "0.0000 ± 0.0072"),
        (1.8e-5, 4e-8, "N", "18.000 ± 0.040 µN"),
        (1.8e-5, -4e-8, "N", "18.000 ± 0.040 µN"),
        (0.11069513, 3e-5, "N", "110.695 ± 0.030 mN"),
        (1.0, 0.0996, "1", "1.00 ± 0.10"),
        (1234.0, 150.0, "1", "1230 ± 150"),
        (3.81e-7, 2e-9, "1", "(3.810 ± 0.020)e-7"),
        (2.5e11, 3e9, "1/s", "(2.500 ± 0.030)e11 1/s"),
        (1.2e-6, 3e-7, "m", "1.20 ± 0.30 µm"),
        (7200.0, 60.0, "s", "7200 ± 60 s"),
        (97.0, 0.0, "N/m", "97 N/m"),
        (97.0, 1e-12, "N/m", "97 N/m"),
        (97.0, math.nan, "N/m", "97 N/m"),
        (math.nan, 0.1, "N/m", "-"),
    ],
)
def test_a_number_has_the_digits_that_its_error_deserves(value, error, unit, text):
    assert with_error(value, error, unit) == text


def test_digits_of_errors_are_those_of_rounding():
    """Both numbers end at one decimal, and neither loses more than half of the last one."""
    draws = np.random.default_rng(1)
    for value, part in zip(draws.normal(size=400), 10 ** draws.uniform(-6, 1, 400), strict=True):
        error = abs(value) * part
        shown, _, shown_error = with_error(value, error).partition(" ± ")
        assert len(shown.partition(".")[2]) == len(shown_error.partition(".")[2])
        assert float(shown_error) == pytest.approx(error, rel=0.051)
        assert abs(float(shown) - value) <= 0.051 * error


def test_a_column_has_one_unit_and_one_number_of_decimals():
    forces = [1.801e-5, 9.2e-6, -2.5e-7, None, math.nan]
    made = column(forces, "N")
    assert made.head("drop") == "drop (µN)"
    assert [made.text(one) for one in forces] == ["18.01", "9.20", "-0.25", "-", "-"]
    assert made.text(1.8e-5, 4e-8) == "18.000 ± 0.040"


@pytest.mark.parametrize(
    ("values", "unit", "head", "texts"),
    [
        ([0.1106951329, 0.05], "N", "x (mN)", ["110.7", "50.0"]),
        ([3.0, 12.0, 4080.0], "1", "x", ["3", "12", "4080"]),
        ([1e-3, 10.0, 4000.0], "s", "x (s)", ["0.001", "10", "4000"]),
        ([1e-7, 1e-6], "m/s", "x (µm/s)", ["0.100", "1.000"]),
        ([0.0], "N", "x (N)", ["0"]),
        ([], "N", "x (N)", []),
        ([math.inf, 1.5], "1", "x", ["inf", "1.500"]),
    ],
)
def test_a_column_suits_its_numbers(values, unit, head, texts):
    made = column(values, unit)
    assert made.head("x") == head
    assert [made.text(one) for one in values] == texts
