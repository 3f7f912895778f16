"""A quantity is a number with a unit; whatever else a person writes is refused in a sentence."""

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from impact_rig.configuration.units import parse_quantity
from impact_rig.core.given.errors import ParameterError


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("21.31 g", "kg", 0.02131),
        ("-1.5e-3 kg", "kg", -0.0015),
        ("45.29 MN/m", "N/m", 45.29e6),
        ("2 kN s/m", "N*s/m", 2000.0),
        ("9.81 m/s²", "m/s**2", 9.81),
        ("9.81 m s**-2", "m/s**2", 9.81),
        ("3 (N s)/m", "N*s/m", 3.0),
        ("200 µs", "s", 2e-4),
        ("50 1/s", "Hz", 50.0),
        ("0.75 %", "dimensionless", 0.0075),
    ],
)
def test_a_number_with_a_unit_is_converted(text, unit, value):
    # Converted in floating point: rounding.
    assert parse_quantity("x", text, unit, "1") == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    "text", ["5", "kg", "1/0 kg", "1e999 kg", "9**9**9**9 kg", "5 9**9**9**9 kg", "5 kg**9**9**9",
             "nan kg", "5 kg(", "5 kg)", "5 (kg", "__import__('os') kg", "5 kg*", "5 kilogrammes"],
)  # fmt: skip
def test_what_is_none_is_refused_and_never_calculated(text):
    with pytest.raises(ParameterError, match=r"^mass is "):
        parse_quantity("mass", text, "kg", "1 kg")


UNIT_LIKE = st.text("kgmsN/*^()²%·1 -9.e", max_size=20)


@given(st.text(max_size=30) | UNIT_LIKE.map(lambda unit: f"5 {unit}"))
@example("5 kg\x00")
@example("5 " + "(" * 500 + "kg")
def test_no_text_is_more_than_a_quantity_or_an_error_in_a_sentence(text):
    try:
        value = parse_quantity("mass", text, "kg", "1 kg")
    except ParameterError as error:
        told = str(error)
        assert told.startswith("mass is ")
    else:
        assert isinstance(value, float)
