"""The dialogues of the driver `scpi`, held by the simulator of PyVISA's makers."""

from pathlib import Path

import pytest

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.given.errors import DeviceError
from impact_rig.core.given.sensors import Sensor
from impact_rig.devices.protocols import AcquisitionPlan, SourceChannel
from impact_rig.devices.scpi import ScpiSource

pytest.importorskip("pyvisa_sim", reason="pip install pyvisa-sim")

SAID = {
    "*IDN?": "REDPITAYA,INSTR2024,0,01-16", "ACQ:RST": None, "ACQ:AVG ON": None,
    "ACQ:DATA:FORMAT BIN": None, "ACQ:TRIG DISABLED": None, "ACQ:START": None,
    "ACQ:STOP": None, "ACQ:TRIG:STAT?": "WAIT", "ACQ:TRIG CH1_PE": None,
}  # fmt: skip
"""A board's answers; None: none. Every other command is an error."""
KEPT = {
    "ACQ:DEC:FACTOR": ("int", "min: 1, max: 65536"),
    "ACQ:SOUR1:GAIN": ("str", "valid: [LV, HV]"),
    "ACQ:SOUR2:GAIN": ("str", "valid: [LV, HV]"),
    "ACQ:DATA:UNITS": ("str", "valid: [RAW, VOLTS]"),
    "ACQ:TRIG:DLY": ("int", "min: -8192, max: 8192"),
    "ACQ:TRIG:LEV": ("float", "min: -20, max: 20"),
    "ACQ:TRIG:HYST": ("float", "min: 0, max: 20"),
}
"""Settings that a board keeps, with what it takes: by Red Pitaya's table of commands."""
FORMATS = {"int": "{:d}", "float": "{:f}", "str": "{}"}
PLAN = AcquisitionPlan(
    sampling_rate=2.5e6,
    record_duration=2.2e-3,
    pre_trigger=0.3e-3,
    trigger_level=49.0,
    hammer=SourceChannel("1", Sensor("hammer", unit="g", sensitivity=0.005)),
    specimen=SourceChannel("2", Sensor("specimen", unit="g", sensitivity=0.005)),
)


@pytest.fixture
def make_source(tmp_path: Path):
    """Return a function that makes a source of a simulated board, whose settings are other."""

    def make(**kept: tuple[str, str]) -> ScpiSource:
        end = r'"\r\n"'
        lines = [
            'spec: "1.1"', "resources: {TCPIP::10.0.0.2::5000::SOCKET: {device: board}}",
            "devices:", "  board:", f"    eom: {{TCPIP SOCKET: {{q: {end}, r: {end}}}}}",
            "    error: ERROR", "    dialogues:",
        ]  # fmt: skip
        for query, answer in SAID.items():
            said = f', r: "{answer}"' if answer else ""
            lines.append(f'      - {{q: "{query}"{said}}}')
        lines.append("    properties:")
        for number, (name, (kind, limits)) in enumerate({**KEPT, **kept}.items()):
            form, default = FORMATS[kind], limits.partition("[")[2].partition(",")[0] or "1"
            lines += [
                f"      p{number}:", f"        default: {default}",
                f'        getter: {{q: "{name}?", r: "{form}"}}',
                f'        setter: {{q: "{name} {form}"}}',
                f"        specs: {{{limits}, type: {kind}}}",
            ]  # fmt: skip
        path = tmp_path / "board.yaml"
        path.write_text("\n".join(lines), "utf-8")
        source = ScpiSource(TomlTable({"address": "10.0.0.2:5000"}, "[source]"))
        source._instrument.library = f"{path}@sim"
        return source

    return make


def test_a_board_takes_every_setting_and_waits_for_its_trigger(make_source):
    source = make_source()
    found = source.configure(PLAN)
    assert found.identity == "REDPITAYA,INSTR2024,0,01-16 at 10.0.0.2:5000"
    assert found.sampling_rate == 2.5e6
    source.check()
    source.arm()
    assert source.read(0.02) is None
    source.close()


def test_a_setting_that_the_board_does_not_take_is_named(make_source):
    source = make_source(**{"ACQ:DEC:FACTOR": ("int", "valid: [1, 8, 64]")})
    with pytest.raises(DeviceError, match=r"to ACQ:DEC:FACTOR., where 50 was set"):
        source.configure(PLAN)
    source.close()
