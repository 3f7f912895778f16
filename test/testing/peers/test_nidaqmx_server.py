"""NI's protocol, spoken to by NI's client library."""

import numpy as np
import pytest

pytest.importorskip("nidaqmx", reason="the server needs the Python package nidaqmx")
pytest.importorskip("grpc", reason="the server needs the Python package grpcio")

from nidaqmx.constants import (
    AccelSensitivityUnits,
    AccelUnits,
    AcquisitionType,
    Slope,
)
from nidaqmx.errors import DaqError, RpcError

from impact_rig.devices.nidaqmx.session import Session
from impact_rig.testing.peers.nidaqmx_server import Input, NidaqmxServer

PATIENCE = 20.0
SENSITIVITY = 0.010 / 9.80665
"""10 mV/g [V per m/s^2]."""


@pytest.fixture
def session():
    sessions = []

    def open_session(address):
        sessions.append(Session("test", address, PATIENCE))
        return sessions[-1]

    yield open_session
    for session in sessions:
        session.close()


def open_acceleration(session):
    """Return a task that triggers at 5 g, 100 points before, 1000 in all."""
    task = session.open_task("record")
    task.ai_channels.add_ai_accel_chan(
        "Dev1/ai0", "a", min_val=-4000.0, max_val=4000.0,
        units=AccelUnits.METERS_PER_SECOND_SQUARED, sensitivity=10.0,
        sensitivity_units=AccelSensitivityUnits.MILLIVOLTS_PER_G, current_excit_val=0.004,
    )  # fmt: skip
    task.timing.cfg_samp_clk_timing(2.5e6, sample_mode=AcquisitionType.FINITE, samps_per_chan=1000)
    task.triggers.reference_trigger.cfg_anlg_edge_ref_trig("a", 100, Slope.RISING, 50.0)
    return task


def read(task):
    from nidaqmx.stream_readers import AnalogSingleChannelReader

    values = np.zeros(1000)
    reader = AnalogSingleChannelReader(task.in_stream)
    reader.verify_array_shape = False
    reader.read_many_sample(values, 1000, 0.0)
    return values


def test_it_listens_on_this_computer_alone_and_on_the_same_port_after_it_was_away(session):
    with NidaqmxServer(SENSITIVITY, SENSITIVITY) as server:
        address = server.address
        assert address.startswith("127.0.0.1:")
        server.unplug()
        with pytest.raises(RpcError, match="UNAVAILABLE"):
            session(address).find_system().devices.device_names  # noqa: B018, it asks the server
        server.plug()
        assert server.address == address
        assert session(address).find_system().devices.device_names == ["Dev1"]


def test_what_it_does_not_simulate_it_says_it_does_not_know(session):
    with NidaqmxServer(SENSITIVITY, SENSITIVITY) as server:
        task = session(server.address).open_task("output")
        with pytest.raises(RpcError, match="UNIMPLEMENTED"):
            task.ao_channels.add_ao_voltage_chan("Dev1/ao0")


def test_a_wait_for_a_trigger_that_does_not_come_ends_in_time(session):
    with NidaqmxServer(SENSITIVITY, SENSITIVITY) as server:
        task = open_acceleration(session(server.address))
        task.start()
        with pytest.raises(DaqError) as found:
            task.wait_until_done(0.05)
        assert found.value.error_code == -200560
        with pytest.raises(DaqError) as found:
            read(task)
        assert found.value.error_code == -200284


def test_its_converter_has_sixteen_bits_and_a_rail():
    channel = Input("a", "Dev1/ai0", units_per_volt=2.0, limit=1.0)
    given = channel.convert(np.array([0.0, 1.0, -1.0, 7.0, -7.0, 0.4 / 32768, 0.6 / 32768]))
    step = 2.0 / 32768
    assert given.tolist() == [0.0, 2.0 - step, -2.0, 2.0 - step, -2.0, 0.0, step]


def test_a_task_of_another_ends_with_its_own_session_only(session):
    with NidaqmxServer(SENSITIVITY, SENSITIVITY) as server:
        first = open_acceleration(session(server.address))
        first.start()
        second = session(server.address)
        task = second.open_task("other")
        task.ai_channels.add_ai_voltage_chan("Dev1/ai1")
        with pytest.raises(DaqError) as found:
            task.start()
        assert found.value.error_code == -50103
        first.close()
        task.start()
