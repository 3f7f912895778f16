"""Hits of a recording in place of a device: the driver `recording`."""

import threading
import time
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import ClassVar

from impact_rig.configuration.toml_table import REQUIRED, TomlTable
from impact_rig.core.errors import DeviceError, FileError, ParameterError
from impact_rig.core.origin import UNSTATED, Origin
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.signals.record import NOT_ARMED, Block, HitLabel
from impact_rig.devices.protocols import Acquisition, AcquisitionPlan, FoundDevice
from impact_rig.recordings.reader import (
    IndexedHit,
    Recording,
    index_hits,
    read_hit,
    read_recording,
)


@dataclass(frozen=True)
class RecordedHits:
    """The hits of one recorded campaign, each handed out once.

    Attributes
    ----------
    recording : Recording
        Where they are.
    hits : sequence of IndexedHit
        In the order in which they were recorded.
    used : set of IndexedHit
        Those that have been delivered.
    sampling_rate : float
        Of all of them [Hz].
    block_size : int
        Points per block, at most.
    """

    recording: Recording
    hits: Sequence[IndexedHit]
    sampling_rate: float
    block_size: int
    used: set[IndexedHit] = field(default_factory=set)

    def list_left(self, sample: str) -> tuple[IndexedHit, ...]:
        """Return the hits of a sample that have not been used.

        Raises
        ------
        DeviceError
            If there is none.
        """
        hits = [hit for hit in self.hits if hit.label.sample == sample]
        left = tuple(hit for hit in hits if hit not in self.used)
        if left:
            return left
        path = self.recording.path
        if hits:
            raise DeviceError(
                f"recording {path} holds no further hit of {sample!r}: it has {len(hits)}"
            )
        known = ", ".join(dict.fromkeys(hit.label.sample for hit in self.hits))
        raise DeviceError(f"recording {path} holds no hit of {sample!r}: it has hits of {known}")

    def choose(self, label: HitLabel) -> IndexedHit:
        """Return the hit of this sample, impact and attempt, else the sample's next one.

        Raises
        ------
        DeviceError
            If the sample has none left.
        """
        left = self.list_left(label.sample)
        for hit in left:
            if (hit.label.impact, hit.label.attempt) == (label.impact, label.attempt):
                return hit
        return left[0]

    def read(self, hit: IndexedHit) -> list[Block]:
        """Return the blocks of a hit.

        Raises
        ------
        DeviceError
            If the file cannot be read, or the hit has another rate than the first one.
        """
        try:
            recorded = read_hit(self.recording, hit)
        except FileError as error:
            raise DeviceError(str(error)) from None
        for block in recorded:
            if block.sampling_rate != self.sampling_rate:
                raise DeviceError(
                    f"record {block.label.record} of {self.recording.path} was sampled at"
                    f" {block.sampling_rate:g} Hz, the first hit at {self.sampling_rate:g} Hz: a"
                    " source has one rate"
                )
        return list(recorded)

    def check_file(self) -> None:
        """Raise `DeviceError` if the recording's files are gone."""
        if not self.recording.path.exists():
            raise DeviceError(f"recording {self.recording.path} is gone")


class RecordingSource:
    """Delivers recorded hits bit by bit: counts, calibration, overload, and every gap.

    A strike plays the recorded hit of its sample, impact and attempt. Where the recording has
    none of that number, it plays the sample's next hit that was not delivered yet. A new set-up
    begins a campaign, for which all hits are there again. A recorded missed trigger is one again.
    The hits are read one at a time; a recording that was never closed has no index and is read
    from its beginning for each.
    """

    description: ClassVar[str] = "the hits of a recording, delivered as if they were measured now"
    example: ClassVar[str] = """\
[source]
driver = "recording"
file = "session.mcap"        # or its folder; relative to the folder where the rig is started
# namespace = "/bench_2"     # which rig, if the recording holds several
# campaign = 2               # which campaign of the recording, counted from 1; else the first
"""

    def __init__(self, options: TomlTable) -> None:
        options.check_keys("file", "namespace", "campaign")
        self._options = options
        self._path = Path(options.take_text("file", REQUIRED, "session.mcap")).expanduser()
        self._namespace = options.take_text("namespace") or None
        self._campaign = options.take_whole("campaign", 1, 1_000_000, 1)
        self._opened: RecordedHits | None = None
        self._is_armed = False
        self._hit: IndexedHit | None = None
        self._blocks: deque[Block] = deque()
        self._due = 0.0
        self._changed = threading.Condition()

    @classmethod
    def find_devices(cls) -> tuple[FoundDevice, ...]:
        """Return nothing: any folder may hold recordings."""
        return ()

    def configure(self, plan: AcquisitionPlan) -> Acquisition:
        """Open the recording and find its hits; of the plan only the block size matters.

        Raises
        ------
        DeviceError
            If there is no such recording, or it holds no hit.
        ParameterError
            If a running stream is wanted.
        """
        if plan.continuous:
            raise ParameterError(
                "a recording is delivered hit by hit: the accelerometers' mode must be 'triggered'"
            )
        try:
            recording = read_recording(self._path, self._namespace)
            campaigns = index_hits(recording)
            if not campaigns:
                raise FileError(f"{recording.path} holds no hit")
            if self._campaign > len(campaigns):
                raise self._options.refuse(
                    "campaign", f"{len(campaigns)} or less: so many are in {recording.path}"
                )
            hits = campaigns[self._campaign - 1]
            rate = read_hit(recording, hits[0])[0].sampling_rate
        except FileError as error:
            raise DeviceError(str(self._options.make_error("file", str(error)))) from None
        with self._changed:
            self._stop()
            self._opened = RecordedHits(recording, hits, rate, plan.block_size)
        return Acquisition(f"recording {recording.path} with {len(hits)} hits", rate)

    def take_setup(self, _: RigSetup) -> None:
        """Begin a campaign: all hits are there again."""
        with self._changed:
            if self._opened is not None:
                self._opened.used.clear()

    def check_sample(self, name: str) -> None:
        """Raise `DeviceError` if the recording has no hit of this sample left."""
        with self._changed:
            self._get_opened().list_left(name)

    def arm(self) -> None:
        """Wait for a strike."""
        with self._changed:
            self._get_opened()
            self._stop()
            self._is_armed = True

    def strike(self, label: HitLabel, swing_time: float) -> None:
        """Let a recorded hit come in `swing_time` seconds.

        Raises
        ------
        DeviceError
            If it is not armed, the sample has no hit left, or the file cannot be read.
        """
        due = time.monotonic() + swing_time
        stamp = time.time_ns() + round(swing_time * 1e9)
        with self._changed:
            opened = self._get_opened()
            if not self._is_armed:
                raise DeviceError(f"{label.sample!r} is struck, but the recording is not armed")
            hit = opened.choose(label)
            recorded = opened.read(hit)
            self._blocks.clear()
            self._blocks.extend(_make_blocks(recorded, stamp, opened.block_size))
            self._hit, self._due = hit, due
            if not self._blocks:
                opened.used.add(hit)
            self._changed.notify_all()

    def read(self, timeout: float) -> Block | None:
        """Return the next block, once the hammer has arrived.

        Raises
        ------
        DeviceError
            If the recording's files are gone.
        """
        deadline = time.monotonic() + timeout
        with self._changed:
            opened = self._get_opened()
            opened.check_file()
            while not self._blocks or self._due > time.monotonic():
                until = min(deadline, self._due) if self._blocks else deadline
                if deadline <= time.monotonic():
                    return None
                self._changed.wait(max(until - time.monotonic(), 0.0))
            block = self._blocks.popleft()
            if block.last and self._hit is not None:
                opened.used.add(self._hit)
                self._is_armed = False
            return block

    def disarm(self) -> None:
        """Wait no more; a hit that was not read to its end may come again."""
        with self._changed:
            self._stop()

    def check(self) -> None:
        """See that the recording's files are there; raises `DeviceError`."""
        with self._changed:
            self._get_opened().check_file()

    def close(self) -> None:
        """Let the recording go."""
        with self._changed:
            self._stop()
            self._opened = None

    def _stop(self) -> None:
        self._is_armed, self._hit = False, None
        self._blocks.clear()

    def _get_opened(self) -> RecordedHits:
        if self._opened is None:
            raise DeviceError(f"recording {self._path} is not open: configure the source first")
        return self._opened


def _make_blocks(recorded: Sequence[Block], stamp: int, size: int) -> Iterator[Block]:
    """Yield the blocks of a hit, none longer than `size`; the first point's time is `stamp`."""
    triggered = [block for block in recorded if block.triggered]
    for block in triggered:
        delay = (block.first_sample - triggered[0].first_sample) / block.sampling_rate
        # A record whose end was lost ends here, too.
        is_last = block is triggered[-1]
        # What does not say where it comes from was not simulated here: that stays unknown.
        origin = Origin(source="a recording") if block.origin == UNSTATED else block.origin
        moved = replace(
            block,
            label=NOT_ARMED,
            last=is_last,
            stamp=stamp + round(delay * 1e9),
            origin=origin,
        )
        yield from moved.split(size)
