"""Results, set-ups and blocks survive the way through a message."""

from contextlib import suppress
from dataclasses import replace
from typing import Any, get_args, get_origin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from impact_rig_msgs import msg

from impact_rig.core.estimates.contact_law import ContactLaw
from impact_rig.core.estimates.paper_method import HammerEstimate
from impact_rig.core.estimates.pulse_shape import PulseShapeEstimate, ShapeFit
from impact_rig.core.estimates.ringing import FreeDecayEstimate
from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.estimates.speed_exponents import SpeedExponents
from impact_rig.core.given.findings import Note, Reason, Subject
from impact_rig.core.given.quantity import LARGEST, BudgetLine, Quantity, StoredField, list_fields
from impact_rig.core.given.sensors import Sensor
from impact_rig.core.given.setup import PAPER_SETUP, AnalysisSettings, RigSetup, Sample
from impact_rig.nodes.intake import UNSOUND
from impact_rig.nodes.interfaces import DIAGNOSTICS, RECORDED_TOPICS, REPLAYER_STATE
from impact_rig.nodes.messages import make_message
from impact_rig.recordings.fields import fill_message, from_message

from ..results.test_wire import SETUP

VALUES = {
    float: st.floats(allow_nan=False),
    int: st.integers(0, 2**32 - 1),
    str: st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=9),
    bool: st.booleans(),
}
CHECKED = {
    Sample: st.just(SETUP.samples.samples[0]),
    Sensor: st.just(SETUP.sensors[0]),
    AnalysisSettings: st.just(AnalysisSettings(7e4, 1.8, 1e-4, 3e-3)),
    Note: st.builds(Note, st.sampled_from([*Reason, *Subject]), VALUES[str]),
    RigSetup: st.just(replace(PAPER_SETUP, hammer_stiffness=2e7, description="on the bench")),
}
"""Records that refuse values which cannot be meant."""


def make_values(hint):
    """Return a strategy for one field of a record."""
    if get_origin(hint) is tuple:
        return st.lists(make_values(get_args(hint)[0]), max_size=2).map(tuple)
    return VALUES[hint] if hint in VALUES else make_records(hint)


def make_records(kind):
    """Return a strategy for a whole record."""
    if kind in CHECKED:
        return CHECKED[kind]
    fields = [field for field in list_fields(kind) if field.name != "notes" or kind != Quantity]
    return st.builds(kind, **{field.name: make_possible(field) for field in fields})


def make_possible(field: StoredField) -> Any:
    """Return what a field may hold."""
    said = field.description
    numbers = st.floats(said.least, said.most)
    if field.hint is float:
        return numbers
    if field.hint is Quantity:
        uncertainties = st.floats(0.0, LARGEST)
        return st.builds(Quantity, numbers, uncertainties, uncertainties, uncertainties)
    return make_values(field.hint)


MESSAGES = {
    AnalysisSettings: msg.AnalysisSettings,
    BudgetLine: msg.UncertaintyContribution,
    ContactLaw: msg.ContactLaw,
    FreeDecayEstimate: msg.FreeDecay,
    HammerEstimate: msg.HammerEstimate,
    PulseShapeEstimate: msg.PulseShape,
    Quantity: msg.Quantity,
    RigSetup: msg.RigSetup,
    Sample: msg.Sample,
    SampleEstimate: msg.SampleEstimate,
    Sensor: msg.Sensor,
    ShapeFit: msg.ShapeFit,
    SpeedExponents: msg.SpeedExponents,
}


@pytest.mark.parametrize("kind", MESSAGES, ids=lambda kind: kind.__name__)
def test_a_record_comes_back_as_it_was(kind):
    @given(make_records(kind))
    @settings(max_examples=10)
    def check(record):
        message = MESSAGES[kind]()
        fill_message(message, record, make_message)
        found = from_message(kind, message)
        # What is not determined is NaN, which equals nothing; a whole number equals a real one.
        assert found == record or repr(found) == repr(record)

    check()


@pytest.mark.parametrize("kind", MESSAGES, ids=lambda kind: kind.__name__)
def test_a_message_has_no_field_that_no_record_fills(kind):
    message = MESSAGES[kind]()
    # When, under which set-up and by which software it was found is the node's to say.
    carried = message.get_fields_and_field_types().keys() - {
        "header", "campaign_id", "software_version", "plan",
    }  # fmt: skip
    names = set()
    for field in list_fields(kind):
        inner = list_fields(field.hint) if field.description.is_inline else [field]
        names |= {item.name for item in inner}
    assert carried == names


@pytest.mark.parametrize(
    "topic", [*RECORDED_TOPICS, DIAGNOSTICS, REPLAYER_STATE], ids=lambda topic: topic.name
)
def test_every_topic_s_conversion_is_there(topic):
    """It is named by a text, and imported when the first message comes."""
    with suppress(*UNSOUND):
        topic.convert(topic.type())
