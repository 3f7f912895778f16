"""The driver `recording`: the hits of a recording, as if they were measured now."""

import threading
import time
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

from impact_rig.configuration.toml_table import REQUIRED, TomlTable
from impact_rig.core.errors import DeviceError, FileError, ParameterError
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.signals.record import Block, HitLabel
from impact_rig.devices.acceleration_source import AcquiredBlock, Acquisition, AcquisitionPlan
from impact_rig.devices.found_device import FoundDevice
from impact_rig.devices.recording.hit_tape import HitTape
from impact_rig.recording.reading.hit_index import IndexedHit, index_hits, read_hit
from impact_rig.recording.reading.mcap_reader import Recording, read_recording


@dataclass(frozen=True)
class _Tape:
    """What is there between `configure` and `close`."""

    recording: Recording
    hits: HitTape
    sampling_rate: float
    block_size: int


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
        self._tape: _Tape | None = None
        self._is_armed = False
        self._hit: IndexedHit | None = None
        self._blocks: deque[AcquiredBlock] = deque()
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
            tape = HitTape(recording.path, hits)
            self._tape = _Tape(recording, tape, rate, plan.block_size)
        return Acquisition(f"recording {recording.path} with {len(hits)} hits", rate)

    def take_setup(self, _: RigSetup) -> None:
        """Begin a campaign: all hits are there again."""
        with self._changed:
            if self._tape is not None:
                self._tape.hits.rewind()

    def check_sample(self, name: str) -> None:
        """Raise `DeviceError` if the recording has no hit of this sample left."""
        with self._changed:
            self._get_tape().hits.find_left(name)

    def arm(self) -> None:
        """Wait for a strike."""
        with self._changed:
            self._get_tape()
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
            tape = self._get_tape()
            if not self._is_armed:
                raise DeviceError(f"{label.sample!r} is struck, but the recording is not armed")
            hit = tape.hits.choose(label)
            try:
                recorded = read_hit(tape.recording, hit)
            except FileError as error:
                raise DeviceError(str(error)) from None
            _check_rate(tape, recorded)
            self._blocks.clear()
            self._blocks.extend(_make_blocks(recorded, stamp, tape.block_size))
            self._hit, self._due = hit, due
            if not self._blocks:
                tape.hits.use(hit)
            self._changed.notify_all()

    def read(self, timeout: float) -> AcquiredBlock | None:
        """Return the next block, once the hammer has arrived.

        Raises
        ------
        DeviceError
            If the recording's files are gone.
        """
        deadline = time.monotonic() + timeout
        with self._changed:
            tape = self._get_tape()
            _check_file(tape)
            while not self._blocks or self._due > time.monotonic():
                until = min(deadline, self._due) if self._blocks else deadline
                if deadline <= time.monotonic():
                    return None
                self._changed.wait(max(until - time.monotonic(), 0.0))
            block = self._blocks.popleft()
            if block.last and self._hit is not None:
                tape.hits.use(self._hit)
                self._is_armed = False
            return block

    def disarm(self) -> None:
        """Wait no more; a hit that was not read to its end may come again."""
        with self._changed:
            self._stop()

    def check(self) -> None:
        """See that the recording's files are there; raises `DeviceError`."""
        with self._changed:
            _check_file(self._get_tape())

    def close(self) -> None:
        """Let the recording go."""
        with self._changed:
            self._stop()
            self._tape = None

    def _stop(self) -> None:
        self._is_armed, self._hit = False, None
        self._blocks.clear()

    def _get_tape(self) -> _Tape:
        if self._tape is None:
            raise DeviceError(f"recording {self._path} is not open: configure the source first")
        return self._tape


def _check_file(tape: _Tape) -> None:
    if not tape.recording.path.exists():
        raise DeviceError(f"recording {tape.recording.path} is gone")


def _check_rate(tape: _Tape, recorded: Sequence[Block]) -> None:
    for block in recorded:
        if block.sampling_rate != tape.sampling_rate:
            raise DeviceError(
                f"record {block.label.record} of {tape.recording.path} was sampled at"
                f" {block.sampling_rate:g} Hz, the first hit at {tape.sampling_rate:g} Hz: a"
                " source has one rate"
            )


def _make_blocks(recorded: Sequence[Block], stamp: int, size: int) -> Iterator[AcquiredBlock]:
    """Yield the blocks of a hit, none longer than `size`; the first point's time is `stamp`."""
    triggered = [block for block in recorded if block.triggered]
    for block in triggered:
        points = block.hammer.output.size
        is_final = block is triggered[-1]
        for start in range(0, max(points, 1), size):
            first_sample = block.first_sample + start
            delay = (first_sample - triggered[0].first_sample) / block.sampling_rate
            part = slice(start, start + size)
            yield AcquiredBlock(
                first_sample=first_sample,
                hammer=replace(block.hammer, output=block.hammer.output[part]),
                specimen=replace(block.specimen, output=block.specimen.output[part]),
                # A record whose end was lost ends here, too.
                last=is_final and start + size >= points,
                stamp=stamp + round(delay * 1e9),
            )
