"""NI's protocol, spoken to by NI's client library."""

import contextlib

import pytest

pytest.importorskip("nidaqmx", reason="the server needs the Python package nidaqmx")
pytest.importorskip("grpc", reason="the server needs the Python package grpcio")

from nidaqmx.errors import RpcError

from impact_rig.devices.nidaqmx.session import Session
from impact_rig.testing.peers.nidaqmx_server import NidaqmxServer

PATIENCE = 20.0
SENSITIVITY = 0.010 / 9.80665
"""10 mV/g [V per m/s^2]."""


def list_devices(address):
    with contextlib.closing(Session("test", address, PATIENCE)) as session:
        return session.find_system().devices.device_names


def test_it_listens_on_this_computer_alone_and_on_the_same_port_after_it_was_away():
    with NidaqmxServer(SENSITIVITY, SENSITIVITY) as server:
        address = server.address
        assert address.startswith("127.0.0.1:")
        server.unplug()
        with pytest.raises(RpcError, match="UNAVAILABLE"):
            list_devices(address)
        server.plug()
        assert server.address == address
        assert list_devices(address) == ["Dev1"]
