"""Measurements of other instruments as one series of hits, and as a recording of it.

A hit was at the time that its file states. One whose file states none, or one before the end of
the hit before, comes `PAUSE` after that end; a series begins with the first time that a file of it
states, or a second after the epoch. So times grow in the order of the files, without a gap of
decades, and the same files make the same recording, byte by byte.
"""

import hashlib
import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from impact_rig import __version__
from impact_rig.core.errors import FileError, SignalError
from impact_rig.core.setup.channel_plan import ChannelPlan
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.core.signals.detection import ImpactDetector, find_pulse_start
from impact_rig.core.signals.record import Block, HitLabel, Trace
from impact_rig.recording.exchange.channel_map import map_channels
from impact_rig.recording.formats.registry import read_measurement
from impact_rig.recording.interfaces.message_encoder import NANOSECONDS, MessageEncoder
from impact_rig.recording.interfaces.qos_profiles import OfferedQos
from impact_rig.recording.writing.mcap_writer import McapWriter
from impact_rig.recording.writing.new_file import write_new_file

FIRST_STAMP = NANOSECONDS
"""When the first hit begins if its file does not say so, nanoseconds since the epoch: not 0, which
in ROS 2 is no time."""
PAUSE = NANOSECONDS
"""Between two hits whose times are not known [ns], our choice: rigs are not struck faster."""
BLOCK_POINTS = 10_000
"""Points per block, our choice: 160 kB, small enough for any subscriber."""

SETUP_QOS = OfferedQos(durability="transient_local", depth=1)
BLOCK_QOS = OfferedQos(depth=200)
"""What the rig's nodes offer on these topics."""


@dataclass(frozen=True)
class ImportedHit:
    """One file as one hit.

    Attributes
    ----------
    path : Path
        Of the file.
    block : Block
        All of both channels, bit by bit; stamped with the time that the file states, or with 0.
    has_scale : bool
        The hammer's numbers make accelerations; see `MappedChannels`.
    assumed : tuple of str
        Bodies whose unit nobody states.
    channels : tuple of str
        Names of the channels in the file.
    """

    path: Path
    block: Block
    has_scale: bool
    assumed: tuple[str, ...]
    channels: tuple[str, ...]

    @property
    def duration(self) -> float:
        """Of the hit [s]."""
        return self.block.hammer.output.size / self.block.sampling_rate


def read_hit(
    path: Path,
    label: HitLabel,
    plan: ChannelPlan,
    hammer_mass: float = math.nan,
    *,
    needs_scale: bool = True,
) -> ImportedHit:
    """Read one file as one hit.

    Parameters
    ----------
    path : Path
        Of any of the formats in `impact_rig.recording.formats.registry`.
    label : HitLabel
        Which hit it is.
    plan : ChannelPlan
        Which channel is what.
    hammer_mass : float
        m1 [kg], which makes accelerations of forces; NaN: not known.
    needs_scale : bool
        Refuse a force without a mass.

    Raises
    ------
    FileError
        If the file cannot be read.
    SignalError, ParameterError
        If its channels do not fit; see `map_channels`.
    """
    measurement = read_measurement(path)
    channels = map_channels(measurement, plan, hammer_mass, needs_scale=needs_scale)
    block = Block(
        label,
        0,
        channels.sampling_rate,
        channels.hammer,
        channels.specimen,
        last=True,
        stamp=channels.stamp,
    )
    return ImportedHit(path, block, channels.has_scale, channels.assumed, channels.names)


def check_series(hits: Sequence[ImportedHit], hit: ImportedHit) -> None:
    """Require a hit that can be averaged with the first of its series.

    Raises
    ------
    SignalError
        If its sampling rate is another, or the sample was measured in one of them only.
    """
    if not hits:
        return
    first, block = hits[0], hit.block
    if block.sampling_rate != first.block.sampling_rate:
        raise SignalError(
            f"{hit.path} is sampled at {block.sampling_rate:g} Hz and {first.path} at"
            f" {first.block.sampling_rate:g} Hz: all hits of a sample need the same rate"
        )
    if block.has_specimen is not first.block.has_specimen:
        with_it, without = (hit, first) if block.has_specimen else (first, hit)
        raise SignalError(
            f"{with_it.path} has a channel of the sample, {without.path} has none: all hits of a"
            " sample need the same channels"
        )


def choose_window(settings: AnalysisSettings, hits: Sequence[ImportedHit]) -> AnalysisSettings:
    """Return settings that make each file, whole, the record of its hit.

    The pre-trigger is the longest time before a pulse; where that cuts off points, it reaches to
    the pulse's peak, behind which no pulse is detected.
    """
    duration = max(hit.duration for hit in hits)
    for find_place in (_find_start, _find_peak):
        places = [max(find_place(hit, settings), 1) / hit.block.sampling_rate for hit in hits]
        chosen = replace(settings, pre_trigger=max(places), record_duration=duration)
        if all(_is_whole(hit, chosen) for hit in hits):
            break
    return chosen


def _is_whole(hit: ImportedHit, settings: AnalysisSettings) -> bool:
    records = ImpactDetector(settings).feed(hit.block)
    sizes = [record.hammer.acceleration.size for record in records]
    return sizes == [hit.block.hammer.output.size]


def _find_start(hit: ImportedHit, settings: AnalysisSettings) -> int:
    """Return where the pulse begins; a tenth of the way where there is none."""
    start = find_pulse_start(_make_trace(hit), settings)
    return hit.block.hammer.output.size // 10 if start is None else start


def _find_peak(hit: ImportedHit, _settings: AnalysisSettings) -> int:
    acceleration = _make_trace(hit).acceleration
    return int(np.argmax(np.abs(acceleration - np.median(acceleration))))


def _make_trace(hit: ImportedHit) -> Trace:
    channel = hit.block.hammer
    return Trace(channel.scale * channel.output.astype(np.float64), channel.full_scale)


def write_imported(output: Path, setup: RigSetup, hits: Sequence[ImportedHit]) -> None:
    """Write a recording of one series of hits.

    Parameters
    ----------
    output : Path
        Of the new `.mcap` file.
    setup : RigSetup
        Masses, sample and settings.
    hits : sequence of ImportedHit
        In their order.

    Raises
    ------
    FileError
        If the file exists already or cannot be written, or the rig's interfaces are not
        installed. Nothing is left then.
    """
    encoder = MessageEncoder()
    with write_new_file(output) as part, McapWriter(part) as writer:
        writer.add_metadata("impact_rig", {"software_version": __version__})
        writer.add_metadata(
            "impact_rig/import", {str(hit.block.label.record): _describe(hit) for hit in hits}
        )
        setups = writer.add_channel("/setup", encoder.setup_definition, (SETUP_QOS,))
        blocks = writer.add_channel("/acceleration", encoder.block_definition, (BLOCK_QOS,))
        stamps = _find_stamps(hits)
        writer.add_message(setups, encoder.encode_setup(setup, stamps[0]), stamps[0], stamps[0])
        for hit, stamp in zip(hits, stamps, strict=True):
            for block in _split(replace(hit.block, stamp=stamp)):
                arrival = block.stamp + _find_duration(block)
                writer.add_message(blocks, encoder.encode_block(block), arrival, arrival)


def _find_stamps(hits: Sequence[ImportedHit]) -> list[int]:
    """Return when each hit begins in the recording [ns since the epoch]."""
    stamps: list[int] = []
    end = next((hit.block.stamp for hit in hits if hit.block.stamp), FIRST_STAMP) - PAUSE
    for hit in hits:
        stated = hit.block.stamp
        stamps.append(stated if stated and stated >= end else end + PAUSE)
        end = stamps[-1] + _find_duration(hit.block)
    return stamps


def _describe(hit: ImportedHit) -> str:
    """Return where a hit comes from, as JSON: enough to find the file and prove that it is it."""
    try:
        with hit.path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise FileError(f"{hit.path} cannot be read: {error.strerror}") from None
    content: dict[str, object] = {
        "file": hit.path.name,
        "sha256": digest,
        "channels": hit.channels,
    }
    if hit.block.stamp:
        # What the file states; the hit may be later in the recording.
        content["recorded_at"] = hit.block.stamp
    return json.dumps(content, ensure_ascii=False)


def _find_duration(block: Block) -> int:
    """Return how long a block is [ns]."""
    return round(block.hammer.output.size / block.sampling_rate * NANOSECONDS)


def _split(whole: Block) -> Iterator[Block]:
    size = whole.hammer.output.size
    for first in range(0, size, BLOCK_POINTS):
        window = slice(first, first + BLOCK_POINTS)
        yield replace(
            whole,
            first_sample=first,
            hammer=replace(whole.hammer, output=whole.hammer.output[window]),
            specimen=replace(whole.specimen, output=whole.specimen.output[window]),
            last=first + BLOCK_POINTS >= size,
            stamp=whole.stamp + round(first / whole.sampling_rate * NANOSECONDS),
        )
