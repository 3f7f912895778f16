"""Options with units."""

import click
import pytest

from impact_rig.cli.options import make_quantity_option, parse_angles
from impact_rig.core.errors import ParameterError


def convert(text):
    """Return what an option makes of a text."""
    command = click.command()(make_quantity_option("--mass", "kg", "100 g", "")(lambda mass: mass))
    return command.main(["--mass", text], standalone_mode=False)


@pytest.mark.parametrize("text", ["0.1", "100g", "100 g", "1e5 mg"])
def test_a_mass_is_read_with_its_unit_or_in_kilograms(text):
    assert convert(text) == pytest.approx(0.1)


@pytest.mark.parametrize("text", ["100 m", "heavy", "", "100 gg"])
def test_what_is_no_mass_is_refused_with_an_example(text):
    with pytest.raises(ParameterError, match='"100 g"'):
        convert(text)


def test_a_cutoff_can_be_off():
    assert convert("off") == 0.0


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("5,x", "--angles is 5,x: write numbers of degrees between commas, like 5,10,20"),
        ("0", "release angle is 0°: it must be above 0° and 90° at most"),
    ],
)
def test_angles_that_cannot_be_meant_are_named(text, told):
    with pytest.raises(ParameterError, match=told):
        parse_angles(None, click.Option(["--angles"]), text)
