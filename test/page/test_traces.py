"""Traces as a browser takes them."""

import json
import struct

import numpy as np
import pytest

from impact_rig.core.given.records import HitLabel
from impact_rig.page.traces import COLUMNS, integrate_hammer, pack_traces
from impact_rig.results.traces import AlignedHit, JudgedTraces

RATE = 2.5e6


def unpack(packed):
    """Return header and pictures, as the page's script reads them."""
    (length,) = struct.unpack_from("<I", packed)
    header, at = json.loads(packed[4 : 4 + length]), 4 + length
    assert at % 4 == 0
    for view in header["views"]:
        view["values"] = []
        for _ in header["channels"]:
            values = np.frombuffer(packed, "<f4", 2 * view["columns"], at)
            view["values"].append(values)
            at += values.nbytes
    assert at == len(packed)
    return header


@pytest.mark.parametrize("channels", [1, 2])
def test_every_extreme_is_seen_however_narrow(channels):
    traces = np.zeros((channels, 5000))
    traces[:, 3210] = 123.0
    traces[:, 700] = -5.0
    hit = AlignedHit(HitLabel("steel", record=7), RATE, -0.25e-3, traces)
    header = unpack(pack_traces(JudgedTraces(hit, True, 200e-6, (2e3,)), [("least peak", 50.0)]))
    assert (header["record"], header["sample"], header["accepted"]) == (7, "steel", True)
    assert header["channels"][0]["lines"] == [{"name": "least peak", "value": 50.0}]
    whole, contact = header["views"]
    assert whole["columns"] == COLUMNS
    for values in whole["values"]:
        assert values.max() == 123.0
        assert values.min() == -5.0
    # From -0.3 ms, where the record begins later, to 0.3 ms.
    assert contact["axis"] == "-0.25 to 0.30 ms"


def test_a_hit_without_a_contact_time_has_one_picture():
    hit = AlignedHit(HitLabel("steel"), RATE, 0.0, np.ones((1, 10)))
    header = unpack(pack_traces(JudgedTraces(hit, False, float("nan"), ())))
    assert [view["name"] for view in header["views"]] == ["whole"]
    assert header["views"][0]["columns"] == 10
    # A flat trace has some height, too.
    assert header["channels"][0]["range"] == [1.0, 2.0]


def test_the_hammers_change_of_speed_is_the_area_of_its_contact_alone():
    time = np.arange(-2000, 3000) / RATE
    trace = np.where(np.abs(time) < 100e-6, -800.0 * np.cos(np.pi * time / 200e-6) ** 2, 0.0)
    trace[np.abs(time) > 300e-6] = 40.0
    hit = AlignedHit(HitLabel("steel"), RATE, float(time[0]), trace[np.newaxis])
    judged = JudgedTraces(hit, True, 200e-6, (2e3,))
    assert integrate_hammer(judged) == pytest.approx(800.0 * 200e-6 / 2.0, rel=1e-3)
    assert np.isnan(integrate_hammer(JudgedTraces(hit, False, float("nan"), ())))
    # A level lies on the side to which the pulse goes.
    header = unpack(pack_traces(judged, [("least peak", 50.0)]))
    assert header["channels"][0]["lines"] == [{"name": "least peak", "value": -50.0}]
