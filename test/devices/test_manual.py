"""An operator as the holder."""

import pytest

from impact_rig.configuration.toml_table import parse_toml_table
from impact_rig.core.errors import ParameterError
from impact_rig.devices.drivers import HOLDERS
from impact_rig.devices.manual import ManualHolder
from impact_rig.devices.protocols import HolderState
from impact_rig.devices.virtual.drivers import VirtualHolder
from impact_rig.testing import DriverContract, HolderBench


def make_holder(text=""):
    return ManualHolder(parse_toml_table("[holder]\n" + text).take_table("holder"))


def test_he_may_take_a_minute_unless_the_rig_file_says_otherwise():
    assert make_holder().patience == 60.0
    assert make_holder('patience = "2 min"').patience == 120.0


def test_an_operator_holds_and_may_release():
    holder = make_holder()
    assert holder.is_by_hand
    assert holder.configure() == "operator"
    holder.release()
    assert holder.read_state() is HolderState.RELEASED
    holder.hold()
    assert holder.read_state() is HolderState.HOLDING


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ('patience = "0 s"', "line 2: patience of .* between 1 and 3600 s"),
        ('patience = "3 m"', "line 2: .*patience"),
        ('port = "/dev/ttyUSB0"', "line 2: .* unknown key 'port'"),
    ],
)
def test_a_key_that_cannot_be_meant_is_named_with_its_line(text, word):
    with pytest.raises(ParameterError, match=word):
        make_holder(text)


class TestHoldersWithoutADevice(DriverContract):
    group = HOLDERS

    @pytest.fixture(params=[ManualHolder, VirtualHolder])
    def bench(self, request):
        bench = HolderBench()
        bench.driver = request.param
        return bench
