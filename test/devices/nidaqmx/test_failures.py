"""Whatever is wrong is one sentence, soon, with the line of the rig file where there is one."""

import socket
import subprocess
import sys
import threading
import time
import warnings
from concurrent.futures import ThreadPoolExecutor

import grpc
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from nidaqmx.errors import DaqError, DaqReadError, DaqWarning, RpcError

from impact_rig.configuration.rig_file import parse_rig_file, read_template
from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.errors import DeviceError, ParameterError, RigError
from impact_rig.devices.drivers import COMMON_KEYS, SOURCES
from impact_rig.devices.nidaqmx import drivers as source_module
from impact_rig.devices.nidaqmx.drivers import NidaqmxSource
from impact_rig.devices.nidaqmx.session import Session, report_errors
from impact_rig.devices.source_table import make_plan
from impact_rig.testing.contract import check_sentence

from .conftest import SOURCE

TIMEOUT = 10.0
SOON = 5.0
"""Much longer than the patience that is set here, much shorter than for ever [s]."""


@pytest.fixture
def impatient(monkeypatch):
    monkeypatch.setattr(source_module, "PATIENCE", 0.3)


def find_line(text, part):
    """Return where in a rig file a text stands last, counted from 1."""
    return max(number for number, line in enumerate(text.splitlines(), 1) if part in line)


@pytest.mark.parametrize(
    ("old", "new", "message", "line"),
    [
        ("Dev1/ai0", "Dev7/ai0", "NI-DAQmx knows no device 'Dev7': known are Dev1", "Dev7"),
        ("Dev1/ai0", "Dev1/ai9", "Dev1 has no analog input 'Dev1/ai9': it has Dev1/ai0", "ai9"),
        ("Dev1/ai0", "ai0", "give device and terminal, like Dev1/ai0", '"ai0"'),
        ("Dev1/ai0", "Dev1/ai0, Dev1/ai1", "give device and terminal", "ai0, Dev1"),
        ('range = "5 V"', 'range = "30 V"', "Property: AI.Max", '"30 V"'),
        ('sensitivity = "10 mV/g"', "", "has no sensitivity", "[source.h"),
        ('range = "5 V"', "", r"lacks range: give it, for example range = \"5 V\"", "[source.h"),
        ('"4 mA"', '"7 mA"', "Property: AI.Excit.Val.*error -200077", '"7 mA"'),
        ('iepe_current = "4 mA"', "", "lacks iepe_current", "[source.h"),
        ('"2.5 MHz"', '"20 MHz"', "Requested Value: 20000000.0; Maximum Value.*-200332", "20 MHz"),
        ('"5 g"', '"900 g"', "channel shows 4903.32 m/s.2 at most", "900 g"),
        ('"2.5 MHz"', '"2.5 MHz"\nserial_number = "77"', "01A2B3C4, not 00000077", '"77"'),
        ('"2.5 MHz"', '"2.5 MHz"\nserial_number = "X"', "the hexadecimal number", '"X"'),
        ('"2.5 MHz"', '"2.5 MHz"\ntrigger = "PFI0"', "analog, or a terminal like", "PFI0"),
        ('"2.5 MHz"', '"2.5 MHz"\ntrigger = "/Dev1/PFI0"\nedge = "either"',
         "one of rising, falling", "edge"),
    ],
)  # fmt: skip
def test_a_wrong_value_is_refused_with_its_line(open_source, write_rig, old, new, message, line):
    text = write_rig()
    head, mark, tail = text.rpartition("\n[source]\n")
    assert old in tail
    text = head + mark + tail.replace(old, new, 1)
    with pytest.raises(RigError, match=message) as found:
        configure(open_source, text)
    check_sentence(found.value)
    assert str(found.value).startswith(f"line {find_line(text, line)}: ")


@pytest.mark.parametrize("server", ["nowhere", "host:99999", ":31763"])
def test_a_server_without_host_and_port_is_refused(server):
    with pytest.raises(ParameterError, match="host and port of NI's server"):
        NidaqmxSource(TomlTable({"server": server}, "[source]"))


def test_the_serial_number_of_the_right_device_is_accepted(open_source, write_rig):
    source, plan = open_source(write_rig(more='serial_number = "1a2b3c4"'))
    assert "01A2B3C4" in source.configure(plan).identity


def test_inputs_that_are_sampled_one_behind_the_other_are_refused(server, open_source):
    server.device.samples_at_once = False
    source, plan = open_source()
    with pytest.raises(ParameterError, match=r"line \d+: Dev1 samples its inputs one behind"):
        source.configure(plan)


def test_a_device_that_another_program_holds_is_named_and_may_be_had_later(
    server, open_source, hit
):
    other = Session("another program", server.address, 5.0)
    task = other.open_task("something else")
    task.ai_channels.add_ai_voltage_chan("Dev1/ai0")
    task.start()
    source, plan = open_source()
    with pytest.raises(DeviceError, match=r"NI device Dev1 .* is held by another.*-50103"):
        source.configure(plan)
    other.close()
    source.configure(plan)
    source.arm()
    server.feed(hit)
    assert source.read(TIMEOUT) is not None


def test_a_task_that_a_lost_connection_left_behind_is_ended(server, open_source, hit):
    source, plan = open_source()
    source.configure(plan)
    source.arm()
    server.unplug()
    source.close()
    server.plug()
    assert server.device.tasks, "the server still has it"
    source.configure(plan)
    assert len(server.device.tasks) == 1
    source.arm()
    server.feed(hit)
    assert source.read(TIMEOUT) is not None


def test_a_device_that_is_unplugged_from_the_server_is_missed_and_comes_back(
    server, open_source, hit
):
    source, plan = open_source()
    source.configure(plan)
    for _ in range(3):
        source.arm()
        timer = threading.Timer(0.05, server.device.set_present, kwargs={"present": False})
        timer.start()
        with pytest.raises(DeviceError, match="NI device Dev1"):
            source.read(TIMEOUT)
        timer.join()
        source.close()
        with pytest.raises(DeviceError, match="knows no device 'Dev1': known are none"):
            source.configure(plan)
        server.device.set_present(present=True)
        source.configure(plan)
    source.arm()
    server.feed(hit)
    assert source.read(TIMEOUT) is not None


@pytest.mark.parametrize(
    ("call", "code"),
    [
        ("CreateTask", -201003),
        ("StartTask", -50405),
        ("ReadAnalogF64", -88709),
        ("StopTask", -999),
    ],
)
def test_an_error_at_any_call_is_one_sentence_with_its_code(server, open_source, hit, call, code):
    server.errors[call] = code
    source, plan = open_source()
    with pytest.raises(DeviceError, match=rf"Dev1.*error {code}") as found:
        read_one(server, source, plan, hit)
    check_sentence(found.value)
    server.errors.clear()
    read_one(server, source, plan, hit)


@pytest.mark.parametrize("call", ["GetDeviceAttributeBool", "StartTask", "WaitUntilTaskDone"])
@pytest.mark.usefixtures("impatient")
def test_a_server_that_does_not_answer_is_given_up(server, open_source, hit, call):
    server.silent.add(call)
    source, plan = open_source()
    begin = time.monotonic()
    with pytest.raises(DeviceError, match="does not answer in time"):
        read_one(server, source, plan, hit, timeout=0.5)
    source.close()
    assert time.monotonic() - begin < SOON
    server.silent.clear()
    read_one(server, source, plan, hit)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda fields: {**fields, "read_array": fields["read_array"][:100]},
        lambda fields: {**fields, "read_array": fields["read_array"][:200],
                        "samps_per_chan_read": 100},
        lambda fields: {**fields, "samps_per_chan_read": -3},
        lambda fields: {},
    ],
    ids=["half", "short", "negative", "nothing"],
)  # fmt: skip
def test_an_answer_that_does_not_fit_is_refused(server, open_source, hit, spoil):
    source, plan = open_source()
    server.spoiled["ReadAnalogF64"] = spoil
    with pytest.raises(DeviceError, match="5000 samples") as found:
        read_one(server, source, plan, hit)
    check_sentence(found.value)


def test_a_port_that_takes_connections_and_says_nothing_is_given_up(
    impatient, write_rig, open_source, server
):
    with socket.create_server(("127.0.0.1", 0)) as other_server:
        address = f"127.0.0.1:{other_server.getsockname()[1]}"
        source, plan = open_source(write_rig(replace={server.address: address}))
        begin = time.monotonic()
        with pytest.raises(DeviceError, match=r"cannot be reached|does not answer"):
            source.configure(plan)
        assert time.monotonic() - begin < SOON


class Nonsense(grpc.GenericRpcHandler):
    """Answers every call with the same bytes."""

    answer = b""

    def service(self, details):
        return grpc.unary_unary_rpc_method_handler(lambda request, context: self.answer)


@pytest.fixture(scope="module")
def nonsense():
    """Return a server whose answers mean nothing, and its address."""
    handler = Nonsense()
    server = grpc.server(ThreadPoolExecutor(2), handlers=[handler])
    address = f"127.0.0.1:{server.add_insecure_port('127.0.0.1:0')}"
    server.start()
    yield handler, address
    server.stop(0).wait()


@given(answer=st.binary(max_size=40))
@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@example(answer=b"\xff" * 20)
@example(answer=b"\x12\x04Dev1")
def test_a_server_whose_answers_mean_nothing_is_no_device(nonsense, answer):
    handler, address = nonsense
    handler.answer = answer
    text = read_template() + SOURCE.format(address=address, more="", hammer="")
    rig = parse_rig_file(text)
    plan = make_plan(rig.source, rig.setup)
    source = NidaqmxSource(rig.source.without(*COMMON_KEYS[SOURCES]))
    with pytest.raises(RigError) as found:
        source.configure(plan)
    check_sentence(found.value)
    source.close()


def test_ni_daqmx_does_not_warn_where_a_task_is_disarmed(server, open_source):
    source, plan = open_source()
    source.configure(plan)
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        source.arm()
        warnings.warn(DaqWarning("It has been stopped.", 200010), stacklevel=1)
        warnings.warn(DaqWarning("Something else.", 200011), stacklevel=1)
    assert ["200011" in str(warning.message) for warning in seen] == [True]


def test_without_ni_daqmx_it_says_what_to_install_or_to_name(write_rig, open_source, server):
    if is_installed():
        pytest.skip("NI-DAQmx is installed here")
    source, plan = open_source(write_rig(replace={f'server = "{server.address}"': ""}))
    for call in (lambda: source.configure(plan), NidaqmxSource.find_devices):
        with pytest.raises(DeviceError, match=r"not installed.*server = "):
            call()


def test_a_process_ends_at_once_with_a_source_that_nobody_closed(server):
    code = """
import sys
from impact_rig.configuration.toml_table import TomlTable
from impact_rig.devices.nidaqmx.drivers import NidaqmxHolder
holder = NidaqmxHolder(TomlTable({"line": "Dev1/port0/line0", "server": sys.argv[1]}))
print(holder.configure())
"""
    command = [sys.executable, "-c", code, server.address]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert "Dev1/port0/line0" in done.stdout
    assert server.device.levels == {"Dev1/port0/line0": True}, "the hammer is still held"


@given(st.text(), st.integers(-2_000_000, -1))
@settings(max_examples=30)
def test_whatever_ni_daqmx_says_becomes_one_sentence(text, code):
    for error in (DaqError(text, code), DaqReadError(text, code, 3), RpcError(14, text)):
        with pytest.raises(RigError) as found, report_errors("NI device Dev1"):
            raise error
        check_sentence(found.value)
        assert str(code) in str(found.value) or isinstance(error, RpcError)


def configure(open_source, text):
    source, plan = open_source(text)
    source.configure(plan)


def read_one(server, source, plan, hit, timeout=TIMEOUT):
    """Go through a source's whole life."""
    source.configure(plan)
    source.arm()
    server.feed(hit)
    assert source.read(timeout) is not None
    source.arm()
    source.disarm()
    source.close()


def is_installed():
    from nidaqmx.errors import Error
    from nidaqmx.system import System

    try:
        return bool(System.local().driver_version)
    except Error:
        return False


@pytest.mark.parametrize("code", [grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.CANCELLED])
def test_a_server_that_goes_before_or_during_a_call_cannot_be_reached(code):
    with (
        pytest.raises(DeviceError, match=r"^NI device Dev1 cannot be reached: is NI's"),
        report_errors("NI device Dev1"),
    ):
        raise RpcError(code, code.name)
