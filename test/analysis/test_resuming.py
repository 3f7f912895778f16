"""A run goes on with its own rig, or is refused, and both are named."""

import json

import pytest

from impact_rig.analysis.resuming import find_rig_of_run
from impact_rig.configuration.rig_file import read_template
from impact_rig.core.given.errors import FileError, ParameterError
from impact_rig.core.given.records import HitLabel, Origin
from impact_rig.core.given.setup import CONTROL_SAMPLE, PAPER_SETUP
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.recordings.messages import MessageEncoder
from impact_rig.recordings.records import OfferedQos
from impact_rig.recordings.writer import RecordingWriter

RIG_FILE = read_template() + '\n[source]\ndriver = "sound"\ndevice = "UMC404HD"\n'
TIME = 1_700_000_000_000_000_000


@pytest.fixture
def make_run(tmp_path):
    """Return a function that records one hit, with a rig file and the keys of the source."""

    def make(rig_file=None, *, source=None, mode="", kind="simulated"):
        folder, encoder = tmp_path / "run", MessageEncoder()
        with RecordingWriter(folder / "session.mcap") as writer:
            if rig_file is not None:
                writer.add_attachment("bench.toml", "application/toml", rig_file.encode())
            if source is not None:
                values = {"mode": mode, "source": source}
                text = "".join(f"{name}: {json.dumps(value)}\n" for name, value in values.items())
                writer.add_metadata("impact_rig/parameters", {"/rig7/accelerometer": text})
            setup = writer.add_channel("/setup", encoder.setup_definition, (OfferedQos(),))
            blocks = writer.add_channel("/acceleration", encoder.block_definition, (OfferedQos(),))
            writer.add_message(setup, encoder.encode_setup(PAPER_SETUP, TIME), TIME, TIME)
            rig = VirtualRig(PAPER_SETUP, VirtualRigSettings())
            for block in rig.strike(HitLabel(CONTROL_SAMPLE, 1, 1)).split(5000, TIME):
                object.__setattr__(block, "origin", Origin(kind, "a device"))
                writer.add_message(blocks, encoder.encode_block(block), TIME, TIME)
        return folder

    return make


def test_a_run_goes_on_with_the_rig_file_in_its_recording(make_run):
    folder = make_run(RIG_FILE, source="seed = 7", mode="continuous", kind="measured")
    for _ in range(2):  # the second time the file is there
        found = find_rig_of_run(folder, None, {"plant": None})
        assert found.rig.path == folder / "bench.toml"
        assert found.rig.source["driver"] == "sound"
        assert (dict(found.source), found.is_continuous) == ({"seed": 7}, True)
    assert sorted(path.name for path in folder.iterdir()) == ["bench.toml", "session.mcap"]


def test_the_same_rig_file_is_taken_and_another_is_refused(make_run, tmp_path):
    folder, mine = make_run(RIG_FILE, source=""), tmp_path / "mine.toml"
    mine.write_text("# a remark\n" + RIG_FILE)
    assert find_rig_of_run(folder, mine, {}).rig.source["device"] == "UMC404HD"
    mine.write_text(RIG_FILE.replace("UMC404HD", "Scarlett"))
    with pytest.raises(ParameterError, match=r"bench\.toml, and .*mine\.toml says .* of source"):
        find_rig_of_run(folder, mine, {})
    # One that was changed in the run's folder is kept, and not used.
    (folder / "bench.toml").write_text(mine.read_text())
    assert find_rig_of_run(folder, None, {}).rig.path == folder / "bench-2.toml"


@pytest.mark.parametrize("kind", ["simulated", "measured"])
def test_a_run_of_the_virtual_rig_goes_on_with_it_alone(make_run, tmp_path, kind):
    folder, other = make_run(kind=kind), tmp_path / "other.toml"
    other.write_text(RIG_FILE)
    with pytest.raises(ParameterError, match=r"the paper's virtual rig, not with .*other"):
        find_rig_of_run(folder, other, {})
    if kind == "measured":  # by a rig without a file
        with pytest.raises(FileError, match="was measured, and does not say by which rig"):
            find_rig_of_run(folder, None, {})
    else:
        assert find_rig_of_run(folder, None, {}).rig.path is None


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"plant": "contact"}, "plant = 'dynamics' of the source, not 'contact'"),
        ({"driver": "virtual"}, "driver = 'sound' of the source, not 'virtual'"),
        ({"gain": 2}, "gain = 'its default' of the source, not 2"),
    ],
)
def test_a_source_that_is_given_must_be_that_of_the_run(make_run, given, told):
    folder = make_run(RIG_FILE, source='plant = "dynamics"')
    assert find_rig_of_run(folder, None, {"plant": "dynamics"}).source == {"plant": "dynamics"}
    with pytest.raises(ParameterError, match=told):
        find_rig_of_run(folder, None, given)
