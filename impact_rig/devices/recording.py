"""Hits of a recording in place of a device: the driver `recording`."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import ClassVar

from impact_rig.configuration.toml_table import REQUIRED, TomlTable
from impact_rig.core.errors import DeviceError, FileError, ParameterError
from impact_rig.core.origin import UNSTATED, Origin
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.signals.record import NOT_ARMED, Block, HitLabel
from impact_rig.devices.protocols import Acquisition, AcquisitionPlan, FoundDevice, HeldBlocks
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
    """

    recording: Recording
    hits: Sequence[IndexedHit]
    sampling_rate: float
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
        self._held = HeldBlocks()
        self._hit: IndexedHit | None = None

    @classmethod
    def find_devices(cls) -> tuple[FoundDevice, ...]:
        """Return nothing: any folder may hold recordings."""
        return ()

    def configure(self, plan: AcquisitionPlan) -> Acquisition:
        """Open the recording and find its hits.

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
        self._held.disarm()
        self._opened = RecordedHits(recording, hits, rate)
        return Acquisition(f"recording {recording.path} with {len(hits)} hits", rate)

    def take_setup(self, _: RigSetup) -> None:
        """Begin a campaign: all hits are there again."""
        if self._opened is not None:
            self._opened.used.clear()

    def check_sample(self, name: str) -> None:
        """Raise `DeviceError` if the recording has no hit of this sample left."""
        self._get_opened().list_left(name)

    def arm(self) -> None:
        """Wait for a strike."""
        self._get_opened()
        self._held.arm()

    def strike(self, label: HitLabel, swing_time: float) -> None:
        """Let a recorded hit come in `swing_time` seconds.

        Raises
        ------
        DeviceError
            If it is not armed, the sample has no hit left, or the file cannot be read.
        """
        contact = time.monotonic() + swing_time
        stamp = time.time_ns() + round(swing_time * 1e9)
        opened = self._get_opened()
        if not self._held.is_armed:
            raise DeviceError(f"{label.sample!r} is struck, but the recording is not armed")
        self._hit = opened.choose(label)
        blocks = _make_blocks(opened.read(self._hit), stamp)
        if blocks:
            self._held.lay(blocks, contact)
        else:
            opened.used.add(self._hit)

    def read(self, timeout: float) -> Block | None:
        """Return the next block, once the hammer has arrived.

        Raises
        ------
        DeviceError
            If the recording's files are gone.
        """
        opened = self._get_opened()
        opened.check_file()
        block = self._held.read(timeout)
        if block is not None and block.last and self._hit is not None:
            opened.used.add(self._hit)
        return block

    def disarm(self) -> None:
        """Wait no more; a hit that was not read to its end may come again."""
        self._held.disarm()

    def check(self) -> None:
        """See that the recording's files are there; raises `DeviceError`."""
        self._get_opened().check_file()

    def close(self) -> None:
        """Let the recording go."""
        self._held.disarm()
        self._opened = None

    def _get_opened(self) -> RecordedHits:
        if self._opened is None:
            raise DeviceError(f"recording {self._path} is not open: configure the source first")
        return self._opened


def _make_blocks(recorded: Sequence[Block], stamp: int) -> list[Block]:
    """Return the blocks of a hit; the first point's time is `stamp`."""
    triggered = [block for block in recorded if block.triggered]
    return [
        replace(
            block,
            label=NOT_ARMED,
            # A record whose end was lost ends here, too.
            last=block is triggered[-1],
            stamp=stamp
            + round((block.first_sample - triggered[0].first_sample) / block.sampling_rate * 1e9),
            # What does not say where it comes from was not simulated here: that stays unknown.
            origin=Origin(source="a recording") if block.origin == UNSTATED else block.origin,
        )
        for block in triggered
    ]
