"""A relay on a serial port, spoken to over a real pseudo-terminal with a board at its end."""

from contextlib import closing

import pytest
from fakes.relay_board import RelayBoard

from impact_rig.configuration.toml_table import parse_toml_table
from impact_rig.core.given.errors import DeviceError, ParameterError
from impact_rig.devices.serial_relay import SerialRelay
from impact_rig.testing import HammerHolderContract, HolderBench


def make_relay(keys):
    return SerialRelay(parse_toml_table("[holder]\n" + keys).take_table("holder"))


def test_a_file_that_is_no_serial_port_is_named(tmp_path):
    path = tmp_path / "file"
    path.touch()
    with pytest.raises(DeviceError, match=f"{path} cannot be opened"):
        make_relay(f'port = "{path}"').configure()


@pytest.mark.parametrize(
    ("keys", "word"),
    [
        ("", "lacks port"),
        ('port = "a"\nchannel = 0', "line 3: channel .* between 1 and 16"),
        ('port = "a"\nenergized = "on"', "one of releases, holds"),
    ],
)
def test_a_key_that_cannot_be_meant_is_named_with_its_line(keys, word):
    with pytest.raises(ParameterError, match=word):
        make_relay(keys)


class RelayBench(HolderBench):
    """A board at the other end of a pseudo-terminal."""

    driver = SerialRelay

    def __init__(self, energized):
        pytest.importorskip("serial", reason="the extra `serial` is not installed")
        self.energized = energized
        self.releases = 0
        self.board = RelayBoard(self.count, holds_on=energized == "holds")
        self.board.plug()
        self.unplug, self.plug = self.board.unplug, self.board.plug

    def count(self):
        self.releases += 1

    def make_holder(self):
        return make_relay(f'port = "{self.board.port}"\nenergized = "{self.energized}"')

    def is_holding(self):
        return self.board.is_holding

    def count_releases(self):
        return self.releases


@pytest.fixture(params=["releases"])
def bench(request):
    """Return a bench whose relay is on while it does what the parameter says."""
    bench = RelayBench(request.param)
    yield bench
    bench.board.stop()


class TestSerialRelay(HammerHolderContract):
    """The contract, on a board at a pseudo-terminal."""


@pytest.mark.parametrize("bench", ["holds"], indirect=True)
def test_a_magnet_that_holds_while_the_relay_is_on_is_switched_on(bench):
    with closing(bench.make_holder()) as holder:
        assert not bench.is_holding()
        holder.configure()
        bench.wait_until(bench.is_holding)
        holder.release()
        bench.wait_until(lambda: bench.releases == 1)


def test_a_port_that_another_program_has_is_named(bench):
    with closing(bench.make_holder()) as first, closing(bench.make_holder()) as second:
        first.configure()
        with pytest.raises(DeviceError, match=r"cannot be opened .*: .* end other programs"):
            second.configure()
        first.close()
        second.configure()
