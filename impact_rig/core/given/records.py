"""Blocks of raw counts, where they come from, and the records they make."""

import math
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.given.errors import (
    SignalError,
    check_choice,
    check_if_known,
    check_not_negative,
    check_positive,
)
from impact_rig.core.given.quantity import Comparable, describe

MEASURED, SIMULATED, IMPORTED = "measured", "simulated", "imported"
UNKNOWN_KIND, MIXED = "unknown", "mixed"
KINDS = (MEASURED, SIMULATED, IMPORTED, UNKNOWN_KIND, MIXED)
"""Kinds of origins; hits of several kinds are mixed."""


@dataclass(frozen=True, slots=True)
class Origin:
    """Where the numbers of a hit come from."""

    kind: str = field(default=UNKNOWN_KIND, metadata=describe(written="origin"))  # one of `KINDS`
    # What delivered them, in its own words.
    source: str = field(default="", metadata=describe(written="origin_source"))
    file: str = ""  # of an imported hit, as it was named
    place: str = ""  # in the file

    def __post_init__(self) -> None:
        """Refuse an unknown kind; a source's words must not steer a terminal."""
        object.__setattr__(self, "kind", self.kind or UNKNOWN_KIND)
        check_choice("the origin of a hit", self.kind, KINDS)
        for name in ("source", "file", "place"):
            if not (text := getattr(self, name)).isprintable():
                plain = "".join(item if item.isprintable() else "?" for item in text)
                object.__setattr__(self, name, plain)

    def __str__(self) -> str:
        """Return kind and source: ``simulated (virtual rig, plant published)``."""
        return f"{self.kind} ({self.source})" if self.source else self.kind


UNSTATED = Origin()
"""Origin of data without a stated one."""


def join_origins(origins: Iterable[Origin]) -> Origin:
    """Return the origin of several hits together; of mixed kinds the source names each."""
    found = dict.fromkeys(Origin(item.kind, item.source) for item in dict.fromkeys(origins))
    kinds = {item.kind for item in found}
    if len(kinds) == 1:
        return Origin(kinds.pop(), "; ".join(item.source for item in found if item.source))
    return Origin(MIXED, ", ".join(map(str, found))) if found else UNSTATED


FloatArray = NDArray[np.float64]
RawArray = NDArray[np.int32] | NDArray[np.float64]
"""A channel before its calibration: counts of a digitizer, or numbers of any other source."""


def make_read_only(values: FloatArray) -> FloatArray:
    """Return `values` as read-only float64: the same array if it is that already, else a copy."""
    return _freeze(np.asarray(values), np.float64)


def _freeze(values: NDArray[Any], dtype: type[np.generic]) -> NDArray[Any]:
    if values.dtype == dtype and not values.flags.writeable:
        return values
    array = values.astype(dtype)
    array.setflags(write=False)
    return array


@dataclass(frozen=True, slots=True)
class HitLabel:
    """Names a hit; numbers count from 1."""

    sample: str  # that was struck
    record: int = 1  # number of the arming
    impact: int = 1  # of the sample's series
    attempt: int = 1  # at this impact

    def __str__(self) -> str:
        """Return ``17 (steel small/3.1)``: record, sample, impact and attempt."""
        return f"{self.record} ({self.sample}/{self.impact}.{self.attempt})"


NOT_ARMED = HitLabel("", record=0, impact=0, attempt=0)
"""Label of a segment of a running stream that belongs to no arming."""


@dataclass(frozen=True)
class ChannelBlock:
    """One channel over one block: acceleration = scale * output + offset."""

    output: RawArray  # (n,), counts, or the numbers of a source that does not count; read-only
    scale: float  # [m/s^2 per unit of the output]
    offset: float  # [m/s^2]
    full_scale: float  # largest acceleration, either sign [m/s^2]; 0: not known
    overloaded: bool = False  # the device says so

    def __post_init__(self) -> None:
        """Make the output read-only, and refuse what cannot be meant."""
        output = np.asarray(self.output)
        is_counted = np.can_cast(output.dtype, np.int32)
        if output.ndim != 1 or not (is_counted or output.dtype in (np.float32, np.float64)):
            raise SignalError(
                f"output of shape {output.shape} and type {output.dtype}: it must be one row of"
                " whole numbers of 32 bits at most, or of floating-point numbers of 64"
            )
        object.__setattr__(self, "output", _freeze(output, np.int32 if is_counted else np.float64))
        if not (math.isfinite(self.scale) and self.scale != 0):
            raise SignalError(f"scale is {self.scale!r} m/s^2 per unit: it must not be zero")
        if not math.isfinite(self.offset):
            raise SignalError(f"offset is {self.offset!r} m/s^2: it must be a finite number")
        check_not_negative("full scale", self.full_scale, "m/s^2")

    @property
    def resolution(self) -> float:
        """Acceleration of one count [m/s^2]; 0: the source does not count."""
        return abs(self.scale) if self.output.dtype == np.int32 else 0.0

    @cached_property
    def acceleration(self) -> FloatArray:
        """The output as acceleration [m/s^2], shape (n,); read-only."""
        acceleration: FloatArray = np.multiply(self.scale, self.output, dtype=np.float64)
        acceleration += self.offset
        acceleration.setflags(write=False)
        return acceleration

    @cached_property
    def extremes(self) -> tuple[float, float]:
        """Least and largest acceleration [m/s^2]; of one point or more."""
        return float(self.acceleration.min()), float(self.acceleration.max())

    def has_calibration_of(self, other: "ChannelBlock") -> bool:
        """Return whether another block's output means the same acceleration."""
        return (
            self.scale == other.scale
            and self.offset == other.offset
            and self.full_scale == other.full_scale
        )


@dataclass(frozen=True)
class MeasuredSpeed(Comparable):
    """A measured speed; NaN: none was measured."""

    value: float = math.nan  # [m/s]
    standard: float = math.nan  # its standard uncertainty [m/s]

    def __post_init__(self) -> None:
        """Refuse what cannot be meant."""
        check_if_known("impact speed", self.value, "m/s")
        if self.is_known:
            check_not_negative("impact speed uncertainty", self.standard, "m/s")

    @property
    def is_known(self) -> bool:
        """Whether it was measured."""
        return not math.isnan(self.value)


NO_SPEED = MeasuredSpeed()
"""Speed that was not measured."""


DISARMED = "the hammer was disarmed before the contact"


@dataclass(frozen=True)
class Block:
    """A contiguous segment of both channels: what a device delivers, and what comes of it."""

    first_sample: int  # counted since arming, in a running stream since its begin; a jump is a gap
    sampling_rate: float  # [Hz]
    hammer: ChannelBlock
    specimen: ChannelBlock  # as long as the hammer's; without points: not measured
    label: HitLabel = NOT_ARMED  # `NOT_ARMED`: none, or not known yet
    triggered: bool = True  # False: the arming ended without a trigger, and the block is empty
    disarmed: str = ""  # of such a block: that the hammer was disarmed before its contact, and why
    last: bool = False  # it ends the record; in a stream the arming, or of no arming the stream
    stamp: int = 0  # of the first point [ns since the epoch]; 0: not known; never computed with
    origin: Origin = UNSTATED
    impact_speed: MeasuredSpeed = NO_SPEED  # of the hammer, before the contact in this block

    def __post_init__(self) -> None:
        """Refuse channels of different length and a rate that is none."""
        check_positive("sampling rate", self.sampling_rate, "Hz")
        if self.specimen.output.size not in (0, self.hammer.output.size):
            raise SignalError(
                f"block at point {self.first_sample} of record {self.label.record} has"
                f" {self.hammer.output.size} hammer points and {self.specimen.output.size}"
                " sample points: both channels must be equally long"
            )

    @property
    def stop(self) -> int:
        """Index behind its last point."""
        return self.first_sample + self.hammer.output.size

    @property
    def has_specimen(self) -> bool:
        """Whether the sample's acceleration was measured."""
        return self.specimen.output.size == self.hammer.output.size

    @property
    def channels(self) -> tuple[ChannelBlock, ...]:
        """Channels of the hammer and, where it was measured, of the sample."""
        return (self.hammer, self.specimen) if self.has_specimen else (self.hammer,)

    @property
    def ends_stream(self) -> bool:
        """Whether nothing more comes of a running stream: its last block, of no arming."""
        return self.last and self.label.record == NOT_ARMED.record

    def cut(self, start: int, stop: int) -> "Block":
        """Return its points from `start` to before `stop`; its end goes with its last point."""
        count = self.hammer.output.size
        if start == 0 and stop >= count:
            return self
        hammer, specimen = (
            replace(channel, output=channel.output[start:stop])
            for channel in (self.hammer, self.specimen)
        )
        return replace(
            self,
            first_sample=self.first_sample + start,
            hammer=hammer,
            specimen=specimen,
            last=self.last and stop >= count,
            stamp=self.stamp + round(start / self.sampling_rate * 1e9) if self.stamp else 0,
        )

    def split(self, size: int) -> Iterator["Block"]:
        """Yield it in pieces of `size` points at most, or as it is if it is no longer."""
        for start in range(0, max(self.hammer.output.size, 1), size):
            yield self.cut(start, start + size)


@dataclass(frozen=True)
class Record(Block):
    """Both channels of one hit, cut out of the stream."""

    pulse_index: int | None = None  # first point above the detection level; None: there is none
    flaws: tuple[str, ...] = ()  # gaps, in words


@dataclass(frozen=True)
class Truth:
    """Truth of a hit of the virtual rig; NaN: its plant has no such quantity.

    `contact_time` [s], on the plant "contact" from first touch to separation, `peak_force` [N];
    `impact_speed` [m/s]; `stiffness` [N/m] and `damping_coefficient` [N s/m] of the sample;
    `exponent` and `restitution` of the contact law [-]; `faults`, which were injected. A recording
    holds contact time, peak force and faults.
    """

    contact_time: float
    peak_force: float
    impact_speed: float = math.nan
    stiffness: float = math.nan
    damping_coefficient: float = math.nan
    exponent: float = math.nan
    restitution: float = math.nan
    faults: tuple[str, ...] = ()


@dataclass(frozen=True)
class PackedRecord:
    """A record in little memory: a fifth of its counts, or less."""

    rest: Record  # without its points
    _outputs: tuple[bytes, ...]  # of the hammer and of the sample

    @classmethod
    def pack(cls, record: Record) -> "PackedRecord":
        """Return a record packed."""
        outputs = (record.hammer.output, record.specimen.output)
        rest = _replace_outputs(record, [np.empty(0, output.dtype) for output in outputs])
        return cls(rest, tuple(map(_compress, outputs)))

    def unpack(self) -> Record:
        """Return the record as it was, bit by bit."""
        kinds = [self.rest.hammer.output.dtype, self.rest.specimen.output.dtype]
        return _replace_outputs(self.rest, map(_decompress, self._outputs, kinds))


def _compress(output: RawArray) -> bytes:
    """Return points with equal bytes of their numbers behind each other, which are alike."""
    table = np.ascontiguousarray(output).view(np.uint8).reshape(-1, output.itemsize)
    return zlib.compress(table.T.tobytes(), level=1)


def _decompress(packed: bytes, kind: np.dtype[Any]) -> RawArray:
    table = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(kind.itemsize, -1)
    return np.ascontiguousarray(table.T).view(kind).ravel()


def _replace_outputs(record: Record, outputs: Iterable[NDArray[Any]]) -> Record:
    channels = zip((record.hammer, record.specimen), outputs, strict=True)
    hammer, specimen = (replace(channel, output=output) for channel, output in channels)
    return replace(record, hammer=hammer, specimen=specimen)
