"""What a person names: files and their description, runs, the same file twice."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from impact_rig.analysis.measured_files import make_series
from impact_rig.analysis.sources import find_repeated_files, find_run
from impact_rig.core.estimates.uncertainty import make_rig_numbers
from impact_rig.core.given.errors import FileError, ParameterError
from impact_rig.core.given.sensors import FLAT, SensorResponse
from impact_rig.files.import_file import MeasurementOptions


@pytest.fixture
def channels(tmp_path):
    """Return a function that writes a file of channels and returns the options that name it."""

    def write(text):
        path = tmp_path / "channels.toml"
        path.write_text(text)
        return MeasurementOptions(channels=path)

    return write


def test_the_file_describes_the_sensors(channels):
    text = '[hammer]\nresonance = "60 kHz"\nlow_corner = "2 Hz"\nupper_corner = "40 kHz"\n'
    setup = make_series(channels(text)).setup
    assert setup.responses == (SensorResponse(60e3, 0.02, 2.0, 40e3), FLAT)


def test_the_file_says_how_sure_gain_corners_and_masses_are(channels):
    text = (
        '[hammer]\nmass = "100 g"\nmass_uncertainty = "0.2 g"\nsensitivity_uncertainty = 0.01\n'
        'upper_corner = "40 kHz"\nupper_corner_uncertainty = "2 kHz"\n'
        '[specimen]\nmass = "50 g"\nmass_uncertainty = "0.1 g"\naccelerometer_mass = "3 g"\n'
        'accelerometer_mass_uncertainty = "0.3 g"\nresonance_uncertainty = "1 kHz"\n'
    )
    setup = make_series(channels(text)).setup
    hammer, specimen = (setup.find_sensor(channel) for channel in ("hammer", "specimen"))
    assert (hammer.sensitivity_uncertainty, hammer.upper_corner_uncertainty) == (0.01, 2e3)
    assert specimen.resonance_uncertainty == 1e3
    assert setup.hammer_mass_uncertainty == pytest.approx(2e-4)
    assert setup.samples.samples[0].mass_uncertainty == pytest.approx(1e-4)
    assert setup.samples.accelerometer_mass_uncertainty == pytest.approx(3e-4)
    # Nothing is assumed of what is stated.
    (note,) = make_rig_numbers(setup, "sample").notes
    assert "gains of specimen within 3 %" in str(note)


def test_options_go_before_the_file(channels):
    text = '[hammer]\nunit = "g"\nmass = "1 kg"\n[analysis]\ncutoff_frequency = "9 kHz"'
    series = make_series(replace(channels(text), hammer_mass=0.1, cutoff=0.0, rate=5e4))
    assert series.plan.hammer.unit == "g"
    assert series.plan.sampling_rate == 5e4
    assert (series.setup.hammer_mass, series.setup.analysis.cutoff_frequency) == (0.1, 0.0)


def test_a_record_begins_a_tenth_of_it_before_its_hit_unless_the_file_says_otherwise(channels):
    given = MeasurementOptions(record_duration=20e-3)
    assert make_series(given).setup.analysis.pre_trigger == pytest.approx(2e-3)
    said = channels('[analysis]\npre_trigger = "5 ms"')
    assert make_series(
        replace(said, record_duration=20e-3)
    ).setup.analysis.pre_trigger == pytest.approx(5e-3)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('[specimen]\nresonance = "70"', "line 2: resonance"),
        ("[specimen]\ncontrol = true", "needs both masses"),
        ('[hammer]\nstiffness = "1 MN/m"\n[specimen]\ncontrol = true', "both give k1"),
        ("[analysis]\npulse_factor = 9.0", "between 1 and 4"),
    ],
)
def test_what_cannot_be_meant_is_refused(channels, text, told):
    with pytest.raises((FileError, ParameterError), match=told):
        make_series(channels(text))


def make_files(folder: Path, *names: str) -> None:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).touch()


def test_a_run_is_its_recording_and_else_its_results(tmp_path):
    make_files(tmp_path, "a/session.mcap", "a/results.json", "b/results.json", "c/notes.txt")
    found = find_run(tmp_path / "a")
    assert found.run is not None
    assert found.run.files == (tmp_path / "a" / "session.mcap",)
    assert found.folder == tmp_path / "a"
    assert find_run(tmp_path / "a" / "results.json").run is None
    found = find_run(tmp_path / "b")
    assert (found.results, found.run) == (tmp_path / "b" / "results.json", None)
    with pytest.raises(FileError, match="a folder without a recording"):
        find_run(tmp_path / "c")


def test_a_run_is_called_by_its_folder_and_a_recording_by_itself(tmp_path):
    make_files(tmp_path, "monday/session.mcap", "tuesday/results.json", "steel.mcap")
    named = ("monday", "tuesday/results.json", "steel.mcap")
    titles = [find_run(tmp_path / name).title for name in named]
    assert titles == ["monday", "tuesday", "steel"]


@pytest.mark.parametrize("make", [Path.symlink_to, shutil.copy2])
def test_a_link_and_a_copy_are_found_by_their_bytes_and_all_else_is_left_to_its_reader(
    tmp_path, make
):
    first = tmp_path / "first.mcap"
    first.write_bytes(b"a recording")
    assert find_repeated_files([first, first]) == {1: f"{first} is named twice: it is used once"}
    empty, also_empty, missing = (tmp_path / name for name in ("a.mcap", "b.mcap", "c.mcap"))
    empty.touch()
    also_empty.touch()
    same_size = tmp_path / "second.mcap"
    same_size.write_bytes(b"another one")
    assert find_repeated_files([first, same_size, missing, missing, empty, also_empty]) == {}
    between, other = first.with_name("between.mcap"), first.with_name("other.mcap")
    between.write_bytes(b"something else in between")
    make(other, first) if make is Path.symlink_to else make(first, other)
    (found,) = find_repeated_files([first, between, other]).items()
    assert found == (2, f"{other} is left out: it is a copy of {first}, byte by byte")
