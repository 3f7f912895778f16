"""What the tests of the accelerometers' sources share."""

import sys
from pathlib import Path

import pytest
from impact_rig_msgs.msg import HammerRelease

from impact_rig.configuration.rig_file import read_template
from impact_rig.nodes import interfaces
from impact_rig.nodes.accelerometer import AccelerometerNode

from .desk_rig import SOURCE


@pytest.fixture
def module(tmp_path, monkeypatch):
    """Install a package that brings the driver `desk`; return the driver's module."""
    metadata = tmp_path / "packages" / "desk_digitizer-1.0.dist-info"
    metadata.mkdir(parents=True)
    (metadata / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: desk-digitizer\nVersion: 1.0\n"
    )
    (metadata / "entry_points.txt").write_text(
        "[impact_rig.acceleration_sources]\n"
        "desk = desk_digitizer:DeskSource\n"
        "unpaid = desk_digitizer_license:DeskSource\n"
    )
    monkeypatch.syspath_prepend(metadata.parent)
    monkeypatch.syspath_prepend(Path(__file__).parent.parent / "third_party")
    import desk_digitizer

    desk_digitizer.DESK = desk_digitizer.Desk()
    yield desk_digitizer
    del sys.modules["desk_digitizer"]


@pytest.fixture
def desk(module):
    return module.DESK


@pytest.fixture
def rig(harness, module, blocks, tmp_path):
    """Return a function that starts the accelerometers with the rig file, and gives a set-up."""

    def start(source=SOURCE, subscribers=1, **parameters):
        path = tmp_path / "rig.toml"
        path.write_text(read_template() + source)
        node = harness.add(
            AccelerometerNode,
            rig_file=str(path),
            **{"trigger_timeout": 0.01, "reconnect_period": 0.02, **parameters},
        )
        harness.wait_until(lambda: node._blocks.get_subscription_count() >= subscribers)
        harness.tell_setup()
        return node

    return start


@pytest.fixture
def blocks(harness):
    return harness.listen(interfaces.ACCELERATION)


@pytest.fixture
def states(harness):
    return harness.listen(interfaces.ACQUISITION_STATE)


@pytest.fixture
def release(harness):
    """Return a function that lets the hammer go for a record."""
    publisher = harness.advertise(interfaces.RELEASE)

    return lambda record, latest_contact=0.0: publisher.publish(
        HammerRelease(record=record, latest_contact=latest_contact)
    )
