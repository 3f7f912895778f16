"""The file of `--channels`: read as written, wrong entries named."""

import pytest

from impact_rig.configuration.units import parse_reading, parse_sensitivity
from impact_rig.core.given.errors import FileError, ParameterError
from impact_rig.core.given.sensors import Sensitivity
from impact_rig.files.import_file import parse_import_file, read_import_file, read_import_template
from impact_rig.files.plan import ChannelUse


def test_the_template_says_what_its_comments_promise():
    file = parse_import_file(read_import_template())
    use = ChannelUse("Acceleration_0", "V", Sensitivity(0.01, "g"), 500.0, "g")
    assert file.plan.hammer == use
    assert parse_import_file("[hammer]\nchannel = 2").plan.hammer.channel == "2"
    assert file.plan.specimen.channel == "Acceleration_1"
    assert (file.sample, file.control) == ("aluminium large", True)
    assert (file.hammer_mass, file.sample_mass) == pytest.approx((0.1, 0.10238))
    assert file.accelerometer_mass == pytest.approx(0.003)
    assert file.settings == {"cutoff_frequency": 50e3}


def test_every_line_of_the_template_that_is_commented_out_can_be_used():
    lines = read_import_template().splitlines()
    plain = [line.removeprefix("# ") if " = " in line else line for line in lines]
    named = [line for line in plain if not line.startswith(("channel", "sampling_rate"))]
    file = parse_import_file("\n".join(named))
    assert file.plan.columns == ("time", "hammer", "specimen")
    assert file.hammer_stiffness == pytest.approx(22.5e6)
    assert file.settings["record_duration"] == pytest.approx(2e-3)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[hamer]", "unknown key 'hamer': did you mean 'hammer'"),
        ("[hammer]\nsensitivity = 10", "sensitivity of .hammer. is 10: .* \"10 mV/g\""),
        ("[hammer]\nsensitivity = '10 mV/s'", "per 's': it must be a voltage per"),
        ("[hammer]\nfull_scale = 500", "full_scale of .hammer. is 500: write it with a unit"),
        ("[specimen]\ncontrol = 'yes'", "control of .specimen. is 'yes'"),
        ("columns = 'time,hammer'", "must be a list of roles"),
        ("columns = ['time', 'force']", "'force' is unknown"),
        ("[analysis]\ncutoff = '50 kHz'", "unknown key 'cutoff'"),
    ],
)  # fmt: skip
def test_what_cannot_be_meant_is_named(tmp_path, text, told):
    with pytest.raises(ParameterError, match=told):
        parse_import_file(text)
    path = tmp_path / "bench.toml"
    path.write_text(text, "utf-8")
    with pytest.raises(FileError, match=rf"bench\.toml: .*{told}"):
        read_import_file(path)


def test_behind_the_stroke_g_is_the_standard_gravity_and_no_gram():
    assert parse_sensitivity("x", "10 mV/g") == Sensitivity(0.01, "g")
    assert parse_sensitivity("x", "1.02 mV/(m/s^2)").unit == "m/s^2"
    assert parse_sensitivity("x", "1.02 mV/m/s^2").unit == "m/s^2"
    assert parse_reading("x", "500 g") == (500.0, "g")
    assert parse_reading("x", "5e3 m/s^2") == (5000.0, "m/s^2")
    assert parse_reading("x", "10V") == (10.0, "V")
