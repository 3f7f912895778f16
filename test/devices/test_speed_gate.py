"""The hammer's speed by a light barrier, against a pendulum that is integrated."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from impact_rig.configuration.rig_file import parse_rig_file
from impact_rig.core.given.errors import ParameterError
from impact_rig.core.given.records import NO_SPEED
from impact_rig.devices.source_table import make_source
from impact_rig.devices.speed_gate import EdgeWatch, SpeedGate

LENGTH, ANGLE, RATE = 0.265, math.radians(3.7), 100e3
SPEED = 2.0 * math.sqrt(9.80665 * LENGTH) * math.sin(ANGLE / 2.0)
"""Of a pendulum that is let go from the angle, at its lowest point [m/s]."""
FLAG = SpeedGate("3", 2.5, 10e-3, 50e-6, 2, math.sqrt(9.80665 / LENGTH))
CONTACT = 0.5
"""When the hammer meets the sample [s]."""


def find_times(places: Sequence[float]) -> np.ndarray:
    """Return when the swinging hammer is so far before its lowest point [m]."""

    def swing(_: float, state: np.ndarray) -> list[float]:
        return [state[1], -9.80665 / LENGTH * math.sin(state[0])]

    def reach(_: float, state: np.ndarray) -> float:
        return float(state[0])

    reach.terminal = True
    found = solve_ivp(
        swing, (0.0, 2.0), [ANGLE, 0.0], rtol=1e-10, atol=1e-12, events=reach, dense_output=True
    )
    times = np.linspace(0.0, found.t[-1], 200_001)
    ways = LENGTH * found.sol(times)[0]
    return CONTACT - found.t[-1] + np.interp(-np.array(places), -ways, times)


def make_signals(edges: np.ndarray, noise: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return hammer and barrier [V] of one second; the flag's edges take 20 µs."""
    times = np.arange(round(RATE)) / RATE
    states = np.arange(edges.size + 1) % 2 * 5.0
    barrier = np.interp(
        times,
        np.stack([edges - 10e-6, edges + 10e-6], axis=1).ravel(),
        np.stack([states[:-1], states[1:]], axis=1).ravel(),
    )
    barrier += noise * np.random.default_rng(1).standard_normal(barrier.size)
    after = np.maximum(times - CONTACT, 0.0)
    return np.exp(-after / 1e-3) * np.sin(2.0 * math.pi * 2e3 * after), barrier


@pytest.mark.parametrize("nearest", [0.0, 1e-3, 4e-3])
def test_a_flag_gives_the_speed_at_the_contact_wherever_the_barrier_is(nearest):
    edges = find_times([nearest + FLAG.distance, nearest])
    found = FLAG.measure(edges, CONTACT + 1e-9, 1.0 / RATE)
    assert found.value == pytest.approx(SPEED, rel=3e-4)
    assert abs(found.value - SPEED) < found.standard < 0.02 * SPEED
    # What the hammer gains between barrier and contact is no small part.
    assert FLAG.distance / (edges[1] - edges[0]) < 0.97 * SPEED


def test_an_encoder_gives_it_too():
    encoder = SpeedGate("3", 2.5, 20 * 0.4e-3, 10e-6, 21, FLAG.rate)
    found = encoder.measure(find_times(np.arange(25, -1, -1) * 0.4e-3), CONTACT + 1e-9, 1e-5)
    assert found.value == pytest.approx(SPEED, rel=3e-4)


def test_the_uncertainty_has_distance_clock_and_pendulum():
    edges = find_times([10e-3, 0.0])
    first = FLAG.measure(edges, CONTACT + 1e-9, 1e-9)
    assert first.standard / SPEED > FLAG.distance_uncertainty / FLAG.distance == 5e-3
    coarse = FLAG.measure(edges, CONTACT + 1e-9, 10e-3)
    assert coarse.standard > 5.0 * first.standard
    far = FLAG.measure(find_times([14e-3, 4e-3]), CONTACT, 1e-9)
    assert far.standard > 1.2 * first.standard


@pytest.mark.parametrize("edges", [[], [0.45], [0.1, 0.11], [0.6, 0.7]])
def test_missed_edges_those_of_another_swing_and_later_ones_give_no_speed(edges):
    assert FLAG.measure(np.array(edges), CONTACT, 1e-6) == NO_SPEED


@pytest.mark.parametrize("size", [1, 777, 100_000])
def test_the_stream_gives_the_speed_once_however_it_is_cut(size):
    hammer, barrier = make_signals(find_times([11e-3, 1e-3]), noise=0.05)
    if size == 1:  # point by point around what happens
        hammer, barrier = hammer[:52_000], barrier[:52_000]
    watch = EdgeWatch(FLAG, 1.0, 0.1)
    found = [
        watch.follow(first, hammer[first : first + size], barrier[first : first + size], RATE)
        for first in range(0, hammer.size, size)
    ]
    (speed,) = [item for item in found if item != NO_SPEED]
    assert speed.value == pytest.approx(SPEED, rel=2e-3)


TABLE = """
[source.impact_speed]
channel = 3
level = 2.5
distance = "10 mm"
distance_uncertainty = "0.05 mm"
"""
RIG = """\
[hammer]
mass = "100 g"
impact_speed = "10.4 cm/s"
release_angle = "3.7 deg"
[source]
driver = "sound"
device = "USB"
sampling_rate = "100 kHz"
trigger_level = "5 g"
[source.hammer]
channel = 1
full_scale = "500 g"
[[sample]]
name = "steel"
mass = "100 g"
"""


def read_gate(text: str) -> SpeedGate:
    rig = parse_rig_file(text)
    _, plan = make_source(rig.source, rig.setup)
    assert plan.gate is not None
    return plan.gate


def test_a_rig_file_describes_it():
    gate = read_gate(RIG.replace("[[sample]]", f"{TABLE}[[sample]]"))
    assert (gate.name, gate.level, gate.distance, gate.edges) == ("3", 2.5, 0.01, 2)
    assert gate.rate == pytest.approx(FLAG.rate, rel=0.01)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('distance = "10 mm"\n', "", r"line 14: \[source.impact_speed\] lacks distance"),
        ('"10 mm"', '"-10 mm"', r"line 17: distance of \[source.impact_speed\] is '-10 mm'"),
        ('"0.05 mm"', '"50 mm"', "line 18: distance_uncertainty of .*: it must be less than"),
        ("level = 2.5", "level = 0", r"line 16: level of \[source.impact_speed\] is 0"),
        ("level = 2.5", "edges = 1", r"line 16: edges of \[source.impact_speed\] is 1"),
        ("level = 2.5", "levl = 2.5", "line 16: .* unknown key 'levl': did you mean 'level'"),
        ('release_angle = "3.7 deg"', "", "line 14: .* needs release_angle in .hammer.: the pen"),
        ('driver = "sound"\ndevice = "USB"', 'driver = "scpi"\naddress = "1.2.3.4:5000"',
         r"line 14: \[source.impact_speed\] cannot be used: the driver 'scpi' reads the two"),
    ],
)  # fmt: skip
def test_what_cannot_be_meant_is_refused_with_its_line(old, new, told):
    text = RIG.replace("[[sample]]", f"{TABLE}[[sample]]").replace(old, new)
    with pytest.raises(ParameterError, match=told):
        read_gate(text)
