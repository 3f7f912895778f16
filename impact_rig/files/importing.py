"""Measurements of other instruments as one series of hits, and as a recording of it.

A hit was at the time that its file states. One whose file states none, or one before the end of
the hit before, comes `PAUSE` after that end; a series begins with the first time that a file of it
states, or a second after the epoch. So times grow in the order of the files, without a gap of
decades, and the same files make the same recording, byte by byte.
"""

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from impact_rig.core.given.errors import SignalError
from impact_rig.core.given.records import Block, HitLabel
from impact_rig.core.given.sensors import CHANNELS
from impact_rig.core.given.setup import AnalysisSettings, RigSetup
from impact_rig.core.hit.detection import ImpactDetector, find_pulse_start
from impact_rig.core.hit.stream import cut_impacts
from impact_rig.files.channels import MeasuredHit, map_channels
from impact_rig.files.formats.registry import read_measurement
from impact_rig.files.plan import ChannelPlan
from impact_rig.recordings.fields import NANOSECONDS
from impact_rig.recordings.messages import MessageEncoder
from impact_rig.recordings.new_file import write_new_file
from impact_rig.recordings.provenance import compute_sha256
from impact_rig.recordings.records import IMPORT_REMARKS, PROVENANCE_RECORD, OfferedQos
from impact_rig.recordings.writer import RecordingWriter
from impact_rig.version import __version__

FIRST_STAMP = NANOSECONDS
"""When the first hit begins if its file states no time [ns since the epoch]; 0 means no time in
ROS 2."""
PAUSE = NANOSECONDS
"""Between two hits whose times are not known [ns], our choice: rigs are not struck faster."""
LIBRARY = "impact_rig-import"
"""Name of the writer in a recording that is a run by itself, whatever its file's name."""
AROUND_CUE, BEFORE_CUE = 0.1, 0.4
"""A hit lies so near a cue [s], less where cues are nearer; this part before it [-]. Our choice:
people and recorders mark it that well."""
BLOCK_POINTS = 10_000
"""Points per block, our choice: 160 kB, small enough for any subscriber."""


def read_hits(
    path: Path,
    label: HitLabel,
    plan: ChannelPlan,
    hammer_mass: float = math.nan,
    *,
    needs_scale: bool = False,
    window: AnalysisSettings | None = None,
) -> list[MeasuredHit]:
    """Read the hits of one file.

    Parameters
    ----------
    path : Path
        Of any of the formats in `impact_rig.files.formats.registry`.
    label : HitLabel
        Which hit the first one is; the others count on.
    plan : ChannelPlan
        Which channel is what.
    hammer_mass : float
        m1 [kg], which makes accelerations of forces; NaN: not known.
    needs_scale : bool
        Ask for all that makes accelerations.
    window : AnalysisSettings, optional
        Whose pre-trigger and record duration each impact is cut out by; None: the channels are one
        hit, whole.

    Raises
    ------
    FileError
        If the file cannot be read.
    SignalError, ParameterError
        If its channels do not fit; see `map_channels`.
    """
    measurement = read_measurement(path)
    hits: list[MeasuredHit] = []
    for whole in map_channels(measurement, plan, hammer_mass, needs_scale=needs_scale):
        for first, block in _cut_hits(whole.block, measurement.cues, window):
            number = label.record + len(hits)
            last = first + block.hammer.output.size - 1
            place = f"{' and '.join(map(repr, whole.names))}, points {first} to {last}"
            labelled = replace(
                block,
                label=replace(label, record=number, impact=number),
                origin=replace(block.origin, place=place),
            )
            hits.append(replace(whole, block=labelled))
    return hits


def _cut_hits(
    whole: Block, cues: Sequence[int], window: AnalysisSettings | None
) -> Iterator[tuple[int, Block]]:
    """Yield each hit with its first point: around cues, by the window, or all of it."""
    size, padding = whole.hammer.output.size, whole.first_sample
    length = min([round(AROUND_CUE * whole.sampling_rate), *map(int, np.diff(cues))])
    before = padding + round(BEFORE_CUE * length)
    starts = [max(cue - before, 0) for cue in cues] if cues else [0]
    for start in starts:
        piece = whole.cut(start, start + length if cues else size)
        piece = replace(piece, first_sample=0, last=True)
        # Where no impact is found, the whole says why.
        for first, block in (cut_impacts(piece, window) if window else ()) or [(0, piece)]:
            yield padding + start + first, block


def check_series(hits: Sequence[MeasuredHit], hit: MeasuredHit) -> None:
    """Raise `SignalError` if a hit cannot be averaged with the first of its series."""
    pair = (*hits[:1], hit)
    kinds = [(len(item.block.channels), item.block.sampling_rate) for item in pair]
    if len(set(kinds)) > 1:
        told = (
            f"{item.path} has {' and '.join(CHANNELS[:count])} at {rate / 1e3:g} kHz"
            for item, (count, rate) in zip(pair, kinds, strict=True)
        )
        raise SignalError(
            f"{', '.join(told)}: all hits of a sample need the same channels and rate"
        )


def choose_window(settings: AnalysisSettings, hits: Sequence[MeasuredHit]) -> AnalysisSettings:
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


def _is_whole(hit: MeasuredHit, settings: AnalysisSettings) -> bool:
    records = ImpactDetector(settings).feed(hit.block)
    sizes = [record.hammer.acceleration.size for record in records]
    return sizes == [hit.block.hammer.output.size]


def _find_start(hit: MeasuredHit, settings: AnalysisSettings) -> int:
    """Return where the pulse begins; a tenth of the way where there is none."""
    start = find_pulse_start(hit.block, settings)
    return hit.block.hammer.output.size // 10 if start is None else start


def _find_peak(hit: MeasuredHit, _settings: AnalysisSettings) -> int:
    output = hit.block.hammer.output
    return int(np.argmax(np.abs(output - np.median(output))))


def write_imported(output: Path, setup: RigSetup, hits: Sequence[MeasuredHit]) -> None:
    """Write a recording of one series of hits.

    Parameters
    ----------
    output : Path
        Of the new `.mcap` file.
    setup : RigSetup
        Masses, sample and settings.
    hits : sequence of MeasuredHit
        In their order.

    Raises
    ------
    FileError
        If the file exists already or cannot be written, or the rig's interfaces are not
        installed. Nothing is left then.
    """
    encoder = MessageEncoder()
    with write_new_file(output) as part, RecordingWriter(part, library=LIBRARY) as writer:
        remarks = dict.fromkeys(remark for hit in hits for remark in hit.remarks)
        made = {"software_version": __version__, IMPORT_REMARKS: "\n".join(remarks)}
        writer.add_metadata(PROVENANCE_RECORD, made)
        digests = {path: compute_sha256(path) for path in dict.fromkeys(hit.path for hit in hits)}
        origins = {str(hit.block.label.record): _describe(hit, digests[hit.path]) for hit in hits}
        writer.add_metadata("impact_rig/import", origins)
        # As the rig's nodes offer these topics.
        state = OfferedQos(durability="transient_local", depth=1)
        setups = writer.add_channel("/setup", encoder.setup_definition, (state,))
        queue = OfferedQos(depth=200)
        blocks = writer.add_channel("/acceleration", encoder.block_definition, (queue,))
        stamps = _assign_stamps(hits)
        writer.add_message(setups, encoder.encode_setup(setup, stamps[0]), stamps[0], stamps[0])
        for hit, stamp in zip(hits, stamps, strict=True):
            for block in replace(hit.block, stamp=stamp).split(BLOCK_POINTS):
                arrival = block.stamp + _compute_duration(block)
                writer.add_message(blocks, encoder.encode_block(block), arrival, arrival)


def _assign_stamps(hits: Sequence[MeasuredHit]) -> list[int]:
    """Return when each hit begins in the recording [ns since the epoch]."""
    stamps: list[int] = []
    end = next((hit.block.stamp for hit in hits if hit.block.stamp), FIRST_STAMP) - PAUSE
    for hit in hits:
        stated = hit.block.stamp
        stamps.append(stated if stated and stated >= end else end + PAUSE)
        end = stamps[-1] + _compute_duration(hit.block)
    return stamps


def _describe(hit: MeasuredHit, digest: str) -> str:
    """Return where a hit comes from, as JSON: enough to find the file and prove that it is it."""
    content: dict[str, object] = {
        "file": hit.path.name,
        "sha256": digest,
        "channels": hit.names,
    }
    if hit.block.stamp:
        # What the file states; the hit may be later in the recording.
        content["recorded_at"] = hit.block.stamp
    return json.dumps(content, ensure_ascii=False)


def _compute_duration(block: Block) -> int:
    """Return how long a block is [ns]."""
    return round(block.hammer.output.size / block.sampling_rate * NANOSECONDS)
