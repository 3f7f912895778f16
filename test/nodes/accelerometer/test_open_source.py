"""The accelerometers read whatever source a rig file names, and say what is wrong with it."""

import pytest

from .desk_rig import SOURCE


@pytest.mark.parametrize(
    ("source", "words"),
    [
        (SOURCE.replace('"desk"', '"dusk"'), "driver of [source] is 'dusk': it must be one of"),
        (SOURCE.replace("serial = 7", "serial = 70"), "it must be a whole number between 1 and 9"),
        (SOURCE.replace("serial", "cereal"), "unknown key 'cereal': did you mean 'serial'?"),
        (SOURCE.replace("10 mV/g", "10 mV/bar", 1), "per 'bar': it must be a voltage per"),
    ],
)
def test_what_a_rig_file_says_wrongly_is_named_with_file_and_line(harness, rig, source, words):
    node = rig(source)
    assert not node.is_configured
    assert "rig.toml: line " in node.fault
    assert words in node.fault


def test_a_driver_whose_library_is_missing_says_which(harness, rig):
    node = rig(SOURCE.replace('"desk"', '"unpaid"'))
    assert not node.is_configured
    assert "'desk_digitizer_license'" in node.fault
    assert "desk-digitizer" in node.fault
