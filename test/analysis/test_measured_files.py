"""What is said of the sensors of measured files comes to the models."""

import pytest

from impact_rig.analysis.measured_files import make_series
from impact_rig.core.errors import FileError, ParameterError
from impact_rig.core.setup.sensors import FLAT, SensorResponse


def test_options_describe_the_sensors_and_go_before_the_file_of_channels(tmp_path):
    file = tmp_path / "channels.toml"
    file.write_text('[hammer]\nresonance = "60 kHz"\nlow_corner = "2 Hz"\n')
    options = {"channels": file, "hammer_resonance": 70e3, "sample_resonance_damping": 0.05}
    setup = make_series(options, {}).setup
    assert setup.responses == (SensorResponse(70e3, 0.02, 2.0), FLAT)
    options = {"sample_resonance": 30e3, "sample_resonance_damping": 0.05}
    setup = make_series(options, {}).setup
    assert setup.responses == (FLAT, SensorResponse(30e3, 0.05))


def test_a_response_of_no_sensor_is_refused_with_its_value(tmp_path):
    with pytest.raises(ParameterError, match=r"resonance of the channel's sensor is -1"):
        make_series({"hammer_resonance": -1.0}, {})
    file = tmp_path / "channels.toml"
    file.write_text('[specimen]\nresonance = "70"\n')
    with pytest.raises(FileError, match=r"line 2: resonance"):
        make_series({"channels": file}, {})
