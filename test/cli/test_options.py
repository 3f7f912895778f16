"""Options with units."""

import click
import pytest

from impact_rig.cli.options import make_quantity_option, parse_angles
from impact_rig.core.given.errors import ParameterError


def convert(text):
    """Return what an option makes of a text."""
    command = click.command()(make_quantity_option("--mass", "kg", "100 g", "")(lambda mass: mass))
    return command.main(["--mass", text], standalone_mode=False)


@pytest.mark.parametrize(("text", "value"), [("100g", 0.1), ("1e5 mg", 0.1), ("off", 0.0)])
def test_a_value_is_read_with_its_unit(text, value):
    assert convert(text) == pytest.approx(value)


@pytest.mark.parametrize("text", ["0.1", "100 m", "heavy", "", "100 gg"])
def test_what_is_no_mass_is_refused_with_an_example(text):
    with pytest.raises(ParameterError, match='"100 g"'):
        convert(text)


def test_angles_that_cannot_be_meant_are_named():
    with pytest.raises(ParameterError, match="write numbers of degrees between commas"):
        parse_angles(None, click.Option(["--angles"]), "5,x")
