"""A line of the device holds the hammer; what the line does is read back."""

import threading

import pytest
from nidaqmx.stream_writers import DigitalSingleChannelWriter

from impact_rig.configuration.toml_table import TomlTable, parse_toml_table
from impact_rig.core.errors import DeviceError, ParameterError
from impact_rig.devices.contract.driver_contract import check_sentence
from impact_rig.devices.drivers import COMMON_KEYS, HOLDERS
from impact_rig.devices.hammer_holder import HolderState
from impact_rig.devices.nidaqmx import holder as holder_module
from impact_rig.devices.nidaqmx.holder import NidaqmxHolder
from impact_rig.devices.nidaqmx.session import Session

LINE = "Dev1/port0/line0"


@pytest.fixture
def open_holder(server):
    """Return what makes a holder on the server; all are closed in the end."""
    holders = []

    def open_holder(**options):
        table = {"line": LINE, "server": server.address, **options}
        holders.append(NidaqmxHolder(TomlTable(table, "[holder]")))
        return holders[-1]

    yield open_holder
    for holder in holders:
        holder.close()


@pytest.mark.parametrize(("energized", "level"), [("holds", True), ("releases", False)])
def test_the_line_is_high_or_low_while_it_holds_as_the_rig_file_says(
    server, open_holder, energized, level
):
    holder = open_holder(energized=energized)
    assert holder.configure() == f"NI virtual digitizer 01A2B3C4, simulated, {LINE}"
    assert server.device.levels[LINE] is level
    holder.release()
    assert server.device.levels[LINE] is not level
    holder.hold()
    assert server.device.levels[LINE] is level


def test_the_line_stays_as_it_is_when_the_holder_is_closed(server, open_holder):
    holder = open_holder()
    holder.configure()
    holder.release()
    holder.close()
    assert server.device.levels[LINE] is False
    holder.configure()
    assert server.device.levels[LINE] is True, "configured, it holds"


def test_a_line_that_contradicts_what_it_was_told_is_an_error(server, open_holder):
    holder = open_holder()
    holder.configure()
    server.device.set_level(LINE, level=False)
    with pytest.raises(DeviceError, match="is low, which is released: it was told holding"):
        holder.read_state()


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("Dev2/port0/line0", "NI-DAQmx knows no device 'Dev2': known are Dev1"),
        ("Dev1/port7/line0", "Dev1 has no output line 'Dev1/port7/line0': it has Dev1/port0/li"),
        ("line0", "give device and terminal"),
    ],
)
def test_a_wrong_line_is_refused_with_its_line_of_the_rig_file(server, line, message):
    text = f'[holder]\ndriver = "nidaqmx"\nserver = "{server.address}"\nline = "{line}"\n'
    table = parse_toml_table(text).take_table("holder")
    holder = NidaqmxHolder(table.without(*COMMON_KEYS[HOLDERS]))
    with pytest.raises((DeviceError, ParameterError), match=f"line 4: .*{message}") as found:
        holder.configure()
    check_sentence(found.value)


def test_a_line_that_another_program_holds_is_not_touched(server, open_holder):
    other = Session("another program", server.address, 5.0)
    task = other.open_task("something else")
    task.do_channels.add_do_chan(LINE)
    DigitalSingleChannelWriter(task.out_stream, auto_start=True).write_one_sample_one_line(0)
    holder = open_holder()
    with pytest.raises(DeviceError, match=r"held by another program.*-50103"):
        holder.configure()
    assert server.device.levels[LINE] is False
    other.close()
    holder.configure()
    assert server.device.levels[LINE] is True


def test_another_device_of_the_same_name_is_refused(server, open_holder):
    with pytest.raises(DeviceError, match="01A2B3C4, not 0000BEEF: it is another device"):
        open_holder(serial_number="BEEF").configure()
    assert LINE not in server.device.levels


@pytest.mark.parametrize("call", ["release", "hold", "read_state"])
def test_before_it_is_configured_and_after_it_is_closed_it_does_nothing(server, open_holder, call):
    holder = open_holder()
    with pytest.raises(DeviceError, match="is not configured"):
        getattr(holder, call)()
    holder.configure()
    holder.close()
    with pytest.raises(DeviceError, match="is not configured"):
        getattr(holder, call)()
    assert server.device.levels[LINE] is True


def test_a_release_that_the_server_never_answers_is_no_release(monkeypatch, server, open_holder):
    monkeypatch.setattr(holder_module, "PATIENCE", 0.1)
    holder = open_holder()
    holder.configure()
    server.silent.add("WriteDigitalLines")
    with pytest.raises(DeviceError, match="does not answer in time"):
        holder.release()
    server.silent.clear()
    assert holder.read_state() is HolderState.HOLDING


def test_a_device_that_is_unplugged_from_the_server_is_missed(server, open_holder):
    holder = open_holder()
    holder.configure()
    server.device.set_present(present=False)
    for call in (holder.read_state, holder.hold, holder.release):
        with pytest.raises(DeviceError, match="error -50405"):
            call()
    holder.close()
    server.device.set_present(present=True)
    holder.configure()
    assert holder.read_state() is HolderState.HOLDING


def test_source_and_holder_share_a_device(server, open_holder, open_source, hit):
    source, plan = open_source()
    holder = open_holder()
    source.configure(plan)
    holder.configure()
    source.arm()
    strike = threading.Timer(0.05, server.feed, [hit])
    holder.release()
    strike.start()
    assert source.read(10.0).hammer.output.size == 1000
    strike.join()
    holder.hold()
    assert server.device.falls == {LINE: 1}
    source.close()
    assert holder.read_state() is HolderState.HOLDING
