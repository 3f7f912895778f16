"""The hammer's speed at the contact, by the edges of a light barrier or an encoder before it."""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impact_rig.configuration.rig_file import take_barrier_distance
from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.given.records import NO_SPEED, FloatArray, MeasuredSpeed
from impact_rig.core.given.setup import RigSetup

PENDULUM_UNCERTAINTY = 0.05
"""Relative standard uncertainty of the pendulum's rate by the rig file [-], our choice."""
HYSTERESIS = 0.1
"""How far a signal must pass its level to count as an edge [level], our choice."""
KEYS = ("channel", "level", "distance", "distance_uncertainty", "edges")


@dataclass(frozen=True)
class SpeedGate:
    """A flag in a light barrier, or an encoder, and how its edges tell the speed.

    The hammer is a pendulum that meets the sample at its lowest point: at the time t before the
    contact it is s = (v / w) sin(w t) away. From the first edge to the last it moves by d, so
    v = w d / (sin(w t1) - sin(w tn)).
    """

    name: str  # of the channel, for the device
    level: float  # of an edge [V]; of a sound card a part of its largest count
    distance: float  # d, the hammer's way from the first of the edges to the last [m]
    distance_uncertainty: float  # standard [m]
    edges: int  # n, rising and falling, the last ones before the contact
    rate: float  # w [rad/s]
    options: TomlTable = field(default_factory=lambda: TomlTable({}))  # the driver's own keys

    def measure(self, edges: FloatArray, contact: float, step: float) -> MeasuredSpeed:
        """Return the speed at the contact; `NO_SPEED` where an edge was missed.

        Parameters
        ----------
        edges : ndarray, shape (n,)
            Times of all edges that were seen [s], ascending.
        contact : float
            Time of the contact, on the same clock [s].
        step : float
            Between two points of the device [s].
        """
        before = (contact - edges[edges < contact])[-self.edges :] * self.rate
        # A quarter of a period ago the hammer was still held.
        if before.size < self.edges or before[0] > math.pi / 2.0:
            return NO_SPEED
        first, last = float(before[0]), float(before[-1])
        way = math.sin(first) - math.sin(last)
        if way <= 0.0:
            return NO_SPEED
        speed = self.rate * self.distance / way
        # What the pendulum gains up to the contact goes with the square of its rate.
        gained = 1.0 - way / (first - last)
        parts = (
            self.distance_uncertainty / self.distance,
            step * self.rate / math.sqrt(6.0) / (first - last),
            2.0 * PENDULUM_UNCERTAINTY * gained,
        )
        return MeasuredSpeed(speed, speed * math.hypot(*parts))


class EdgeWatch:
    """Finds the edges in a running signal, and measures the speed of each hit.

    Parameters
    ----------
    gate : SpeedGate
        What the edges mean.
    unit : float
        What the device delivers for one unit of the gate's level.
    trigger : float
        Size of the hammer's signal at which a contact has begun, as the device delivers it.
    """

    def __init__(self, gate: SpeedGate, unit: float, trigger: float) -> None:
        self._gate, self._trigger = gate, trigger
        self._low = (1.0 - HYSTERESIS) * gate.level * unit
        self._high = (1.0 + HYSTERESIS) * gate.level * unit
        self._is_high: bool | None = None  # None: not known yet
        self._edges: list[float] = []  # [points]
        self._before = 0.0  # the hammer's point before

    def follow(
        self, first: int, hammer: NDArray[Any], signal: NDArray[Any], sampling_rate: float
    ) -> MeasuredSpeed:
        """Take the next points of both, shape (n,); return the speed of the hit in them.

        What was measured once is forgotten: a hammer that rings is not measured again.
        """
        places = np.flatnonzero((signal >= self._high) | (signal <= self._low))
        states = signal[places] >= self._high
        if places.size:
            known = bool(states[0]) if self._is_high is None else self._is_high
            changes = np.flatnonzero(np.diff(states, prepend=known))
            # An edge lies between two points.
            self._edges += (first + places[changes] - 0.5).tolist()
            self._is_high = bool(states[-1])
        del self._edges[: -10 * self._gate.edges]
        is_large = np.abs(np.append(self._before, hammer)) >= self._trigger
        self._before = float(hammer[-1])
        contacts = np.flatnonzero(is_large[1:] & ~is_large[:-1])
        if not contacts.size:
            return NO_SPEED
        edges, contact = np.array(self._edges), float(first + contacts[0])
        self._edges = [edge for edge in self._edges if edge > contact]
        return self._gate.measure(
            edges / sampling_rate, contact / sampling_rate, 1.0 / sampling_rate
        )


def take_channel_name(table: TomlTable) -> str:
    """Return the device's name of the channel of a sensor or barrier; empty: not given."""
    name = table.get("channel", "")
    if isinstance(name, bool) or not isinstance(name, str | int):
        raise table.refuse("channel", "the device's name of the channel in quotes, or a number")
    return str(name)


def take_speed_gate(source: TomlTable, setup: RigSetup) -> SpeedGate | None:
    """Return the barrier of [source.impact_speed]; None: there is no such table.

    Raises
    ------
    ParameterError
        If a value is missing or cannot be meant; the message names its line.
    """
    if "impact_speed" not in source:
        return None
    table = source.take_table("impact_speed")
    table.check_keys(*KEYS, "properties")  # of a channel of openDAQ
    name = take_channel_name(table)
    if math.isnan(setup.pendulum_rate):
        raise table.make_error(
            "",
            f"{table.place} needs release_angle in [hammer]: the pendulum gains speed between"
            " the barrier and the contact",
        )
    distance = take_barrier_distance(table)
    standard = table.take_quantity("distance_uncertainty", "m", "0.05 mm", 0.0, low=0.0)
    if not 0.0 <= standard < distance:
        raise table.refuse("distance_uncertainty", "less than the distance")
    return SpeedGate(
        name=name,
        level=table.take_number("level", 1e-9, default=1.0),
        distance=distance,
        distance_uncertainty=standard,
        edges=table.take_whole("edges", 2, 1000, 2),
        rate=setup.pendulum_rate,
        options=table.without(*KEYS),
    )
