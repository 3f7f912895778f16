"""An operator as the holder."""

import pytest

from impact_rig.configuration.toml_table import parse_toml_table
from impact_rig.core.given.errors import ParameterError
from impact_rig.devices.drivers import HOLDERS
from impact_rig.devices.manual import ManualHolder
from impact_rig.devices.protocols import HammerHolder
from impact_rig.devices.virtual.drivers import VirtualHolder
from impact_rig.testing import DriverContract, HolderBench


def make_holder(text=""):
    return ManualHolder(parse_toml_table("[holder]\n" + text).take_table("holder"))


def test_an_operator_holds_and_may_take_his_time_to_release():
    assert make_holder().patience == 60.0
    holder = make_holder('patience = "2 min"')
    assert (holder.is_by_hand, holder.patience) == (True, 120.0)
    assert holder.configure() == "operator"


def test_a_patience_that_cannot_be_meant_is_named_with_its_line():
    with pytest.raises(ParameterError, match=r"line 2: patience of .* between 1 and 3600 s"):
        make_holder('patience = "0 s"')


class TestHoldersWithoutADevice(DriverContract):
    group, protocol = HOLDERS, HammerHolder

    @pytest.fixture(params=[ManualHolder, VirtualHolder])
    def bench(self, request):
        bench = HolderBench()
        bench.driver = request.param
        return bench
