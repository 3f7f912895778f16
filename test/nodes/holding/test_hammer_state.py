"""What the interlock calls by number is what the message calls so."""

import pytest
from impact_rig_msgs.msg import HammerState

from impact_rig.nodes.holding.guarded_hammer import Disarming, HammerPlace


@pytest.mark.parametrize("value", [*HammerPlace, *Disarming], ids=lambda value: value.name)
def test_numbers_are_those_of_the_message(value):
    assert getattr(HammerState, value.name) == value
