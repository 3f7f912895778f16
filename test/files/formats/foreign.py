"""Traces to write with other tools, and what is read of them."""

import numpy as np

from impact_rig.files.formats.registry import read_measurement

RATE = 51200.0
TRACE = np.sin(np.arange(40) / 3) / 3


def read_channels(path):
    return {channel.name: channel for channel in read_measurement(path).channels}


def describe(channel):
    return channel.values.tolist(), channel.sampling_rate, channel.unit, channel.start


def make_function(**changes):
    function = {
        "type": 58, "func_type": 1, "rsp_node": 3, "rsp_dir": 3, "ref_node": 1, "ref_dir": -3,
        "id1": "hammer", "x": 0.25 + np.arange(40) / RATE, "data": TRACE, "binary": 1,
        "abscissa_spacing": 1, "orddenom_spec_data_type": 0, "ordinate_axis_units_lab": "g",
    }  # fmt: skip
    return function | changes
