"""Options of the command line and the file of channels make one series."""

import pytest

from impact_rig.analysis.measured_files import make_series
from impact_rig.core.errors import FileError, ParameterError
from impact_rig.core.sensors import FLAT, SensorResponse


@pytest.fixture
def channels(tmp_path):
    """Return a function that writes a file of channels and returns the option that names it."""

    def write(text):
        path = tmp_path / "channels.toml"
        path.write_text(text)
        return {"channels": path}

    return write


def test_the_file_describes_the_sensors(channels):
    text = '[hammer]\nresonance = "60 kHz"\nlow_corner = "2 Hz"\n'
    setup = make_series(channels(text)).setup
    assert setup.responses == (SensorResponse(60e3, 0.02, 2.0), FLAT)


def test_options_go_before_the_file(channels):
    text = '[hammer]\nunit = "g"\nmass = "1 kg"\n[analysis]\ncutoff_frequency = "9 kHz"'
    series = make_series(channels(text) | {"hammer_mass": 0.1, "cutoff": 0.0, "rate": 5e4})
    assert series.plan.hammer.unit == "g"
    assert series.plan.sampling_rate == 5e4
    assert (series.setup.hammer_mass, series.setup.analysis.cutoff_frequency) == (0.1, 0.0)


def test_a_record_begins_a_tenth_of_it_before_its_hit_unless_the_file_says_otherwise(channels):
    given = {"record_duration": 20e-3}
    assert make_series(given).setup.analysis.pre_trigger == pytest.approx(2e-3)
    said = channels('[analysis]\npre_trigger = "5 ms"')
    assert make_series(given | said).setup.analysis.pre_trigger == pytest.approx(5e-3)


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
