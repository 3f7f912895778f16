"""Results travel as messages and come back as they were, bit by bit."""

from dataclasses import fields
from typing import get_args, get_origin, get_type_hints

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impact_rig.nodes.result_messages import MESSAGES, result_from_msg, result_to_msg
from impact_rig.results.estimates import SampleResults

VALUES = {
    float: st.floats(allow_nan=False),
    int: st.integers(0, 2**32 - 1),
    str: st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=9),
    bool: st.booleans(),
}


def make_values(hint):
    """Return a strategy for one field of a result."""
    if get_origin(hint) is tuple:
        return st.lists(make_values(get_args(hint)[0]), max_size=2).map(tuple)
    return VALUES[hint] if hint in VALUES else make_results(hint)


def make_results(kind):
    """Return a strategy for a whole result."""
    hints = get_type_hints(kind)
    return st.builds(
        kind, **{field.name: make_values(hints[field.name]) for field in fields(kind)}
    )


@pytest.mark.parametrize("kind", MESSAGES, ids=lambda kind: kind.__name__)
def test_a_result_comes_back_as_it_was(kind):
    @given(make_results(kind))
    @settings(max_examples=10)
    def check(result):
        assert result_from_msg(kind, result_to_msg(result)) == result

    check()


@pytest.mark.parametrize("kind", MESSAGES, ids=lambda kind: kind.__name__)
def test_a_message_has_no_field_that_no_result_fills(kind):
    message = MESSAGES[kind]()
    # When and under which set-up it was found is the node's to say.
    carried = message.get_fields_and_field_types().keys() - {"header", "setup_stamp"}
    assert len(carried) == len(fields(kind))


def test_units_stay_at_home():
    message = result_to_msg(
        SampleResults("steel", 3, 1, contact_time_s=2e-4, stiffness_u_n_per_m=5.0)
    )
    assert (message.sample, message.contact_time, message.stiffness_u) == ("steel", 2e-4, 5.0)
