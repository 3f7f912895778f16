"""What is not known equals itself, on every Python."""

from dataclasses import replace

import pytest

from impact_rig.core.quantity import Quantity
from impact_rig.core.setup import PAPER_SETUP

KINDS = {
    "setup": PAPER_SETUP,
    "quantity": Quantity(),
    "sample": PAPER_SETUP.samples.find("steel small"),
}


@pytest.mark.parametrize("record", KINDS.values(), ids=KINDS)
def test_a_value_that_is_not_known_is_no_difference(record):
    name = "standard" if isinstance(record, Quantity) else "release_angle"
    once, again = (replace(record, **{name: float("nan")}) for _ in range(2))
    assert once == again
    assert hash(once) == hash(again)
    assert len({once, again}) == 1
    assert once != replace(record, **{name: 0.1})


def test_records_of_two_kinds_differ():
    assert Quantity() != PAPER_SETUP
    assert Quantity() != 0.0
