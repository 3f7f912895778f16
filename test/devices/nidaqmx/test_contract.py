"""The drivers keep the contract of all drivers, against a server that speaks NI's protocol."""

import pytest

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.devices.contract.benches import HolderBench, SourceBench
from impact_rig.devices.contract.holder_contract import HammerHolderContract
from impact_rig.devices.contract.source_contract import AccelerationSourceContract
from impact_rig.devices.nidaqmx.holder import NidaqmxHolder
from impact_rig.devices.nidaqmx.source import NidaqmxSource

LINE = "Dev1/port0/line3"
RECORD_BLOCK, STREAM_BLOCK = 1000, 25_000
"""Points, as the node asks for them: a busy machine has no time for 2500 reads a second."""


class NiSourceBench(SourceBench):
    def __init__(self, server, open_source, hit):
        self.server = server
        self.open_source = open_source
        self.hit = hit

    def get_driver(self):
        return NidaqmxSource

    def make_source(self):
        return self.open_source()[0]

    def make_plan(self, *, continuous=False):
        block_size = STREAM_BLOCK if continuous else RECORD_BLOCK
        return self.open_source(continuous=continuous, block_size=block_size)[1]

    def strike(self, source):
        self.server.feed(self.hit)

    def unplug(self):
        self.server.unplug()

    def plug(self):
        self.server.plug()


class NiHolderBench(HolderBench):
    def __init__(self, server):
        self.server = server

    def get_driver(self):
        return NidaqmxHolder

    def make_holder(self):
        options = {"line": LINE, "server": self.server.address}
        return NidaqmxHolder(TomlTable(options, "[holder]"))

    def unplug(self):
        self.server.unplug()

    def plug(self):
        self.server.plug()

    def is_holding(self):
        return self.server.device.levels[LINE]

    def count_releases(self):
        return self.server.device.falls.get(LINE, 0)


class TestNidaqmxSource(AccelerationSourceContract):
    @pytest.fixture
    def bench(self, server, open_source, hit):
        return NiSourceBench(server, open_source, hit)


class TestNidaqmxHolder(HammerHolderContract):
    @pytest.fixture
    def bench(self, server):
        return NiHolderBench(server)
