"""NI's protocol over a real socket: the drivers on one side, a simulated device on the other."""

from dataclasses import replace

import pytest

pytest.importorskip("nidaqmx", reason="the drivers need the Python package nidaqmx")
pytest.importorskip("grpc", reason="the drivers need the Python package grpcio")

from impact_rig.configuration.rig_file import parse_rig_file, read_template
from impact_rig.core.signals.record import HitLabel
from impact_rig.devices.drivers import COMMON_KEYS, SOURCES
from impact_rig.devices.nidaqmx.drivers import NidaqmxSource
from impact_rig.devices.source_table import make_plan
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.testing.peers.nidaqmx_server import NidaqmxServer

HAMMER_SENSITIVITY = 0.010 / 9.80665
SPECIMEN_SENSITIVITY = -0.005 / 9.80665
"""[V per m/s^2]; the sample's sensor looks the other way."""
SOURCE = """
[source]
driver = "nidaqmx"
sampling_rate = "2.5 MHz"
record_duration = "2 ms"
pre_trigger = "200 us"
trigger_level = "5 g"
server = "{address}"
{more}
[source.hammer]
channel = "Dev1/ai0"
sensitivity = "10 mV/g"
iepe_current = "4 mA"
range = "5 V"
{hammer}
[source.specimen]
channel = "Dev1/ai1"
sensitivity = "-5 mV/g"
iepe_current = "4 mA"
range = "5 V"
"""


@pytest.fixture
def server():
    with NidaqmxServer(HAMMER_SENSITIVITY, SPECIMEN_SENSITIVITY) as server:
        yield server


@pytest.fixture(scope="session")
def hit():
    """Return a hit of the virtual rig, noise and all."""
    setup = parse_rig_file(read_template()).setup
    return VirtualRig(setup, VirtualRigSettings()).strike(HitLabel(setup.samples.samples[0].name))


@pytest.fixture
def write_rig(server):
    """Return a writer of rig files for the server."""

    def write(more="", hammer="", **changes):
        text = SOURCE.format(address=server.address, more=more, hammer=hammer)
        for old, new in changes.get("replace", {}).items():
            assert old in text
            text = text.replace(old, new)
        return read_template() + text

    return write


@pytest.fixture
def open_source(write_rig):
    """Return what makes a source and its plan of a rig file."""
    sources = []

    def open_source(text=None, *, continuous=False, block_size=1000, depth=400):
        rig = parse_rig_file(text or write_rig())
        sources.append(NidaqmxSource(rig.source.without(*COMMON_KEYS[SOURCES])))
        plan = make_plan(rig.source, rig.setup)
        return sources[-1], replace(
            plan, continuous=continuous, block_size=block_size, depth=depth
        )

    yield open_source
    for source in sources:
        source.close()
