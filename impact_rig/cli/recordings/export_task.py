"""What is exported, from which hits, to which files."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import click

from impact_rig.core.errors import FileError, ParameterError
from impact_rig.core.hits.overrule import find_label
from impact_rig.recording.exchange.exporting import ExportedCampaign, ExportedHit, read_campaigns
from impact_rig.recording.formats.measurement import MeasuredChannel, Measurement
from impact_rig.recording.formats.registry import WRITABLE, write_measurement
from impact_rig.recording.reading.mcap_reader import Recording, read_recording
from impact_rig.recording.writing.new_file import write_new_file
from impact_rig.results.campaign import Results
from impact_rig.results.flat_estimates import results_from_session
from impact_rig.results.results_file import format_json, results_to_json
from impact_rig.results.results_table import format_results_table

RESULTS_ONLY = ".json"
RESULTS_SUFFIXES = (RESULTS_ONLY, ".csv")
"""What results are written to."""
DEFAULT_PARTS = {".json": {"results"}, ".csv": {"hits"}}
"""What is exported by suffix where nothing is said: columns of text share their time, which hits
and means do not."""
OTHER_PARTS = {"hits", "means"}
_AWKWARD = re.compile(r"[^\w.+-]+")
"""What file names are better without."""

Group = tuple[str, tuple[MeasuredChannel, ...]]
"""Name and channels of one hit or mean."""


@dataclass(frozen=True)
class ExportTask:
    """What is to be exported.

    Attributes
    ----------
    output : Path
        File, or folder of one file for each hit.
    what : frozenset of str or None
        Of hits, means and results; None: as suits the format.
    samples, hits : tuple of str
        Names of those that are wanted; empty: all.
    is_accepted_only : bool
        Without rejected hits.
    is_filtered : bool
        Hits after baseline and low-pass.
    is_split : bool
        One file for each hit or mean.
    suffix : str or None
        Of these files.
    """

    output: Path
    what: frozenset[str] | None = None
    samples: tuple[str, ...] = ()
    hits: tuple[str, ...] = ()
    is_accepted_only: bool = False
    is_filtered: bool = False
    is_split: bool = False
    suffix: str | None = None

    def __post_init__(self) -> None:
        """Refuse what does not go together."""
        if self.is_split and self.suffix is None:
            raise ParameterError(
                f"--one-file-per-hit needs --format, one of {_list_formats(WRITABLE)}"
            )
        if self.suffix is not None and not self.is_split:
            raise ParameterError(
                f"--format is for --one-file-per-hit: the suffix of {self.output} tells its format"
            )
        has_results = "results" in self.parts
        if has_results and (len(self.parts) > 1 or self.is_split):
            raise ParameterError("results and traces do not go into the same files: export apart")
        if self.kind not in (RESULTS_SUFFIXES if has_results else WRITABLE):
            raise ParameterError(
                f"{'results' if has_results else 'traces'} are not written to"
                f" {self.kind or 'files without a suffix'}: choose one of"
                f" {_list_formats(RESULTS_SUFFIXES if has_results else WRITABLE)}"
            )

    @property
    def kind(self) -> str:
        """Suffix of what is written."""
        return self.suffix or self.output.suffix.lower()

    @property
    def parts(self) -> frozenset[str]:
        """What is exported."""
        return self.what or frozenset(
            {"hits"} if self.hits else DEFAULT_PARTS.get(self.kind, OTHER_PARTS)
        )


def export_recording(path: Path, task: ExportTask) -> str:
    """Export a recording; return what was written, in words.

    Raises
    ------
    FileError
        If the recording cannot be read, holds nothing of what is wanted, or a file exists already
        or cannot be written.
    ParameterError
        If there is no such sample or hit.
    """
    recording = read_recording(path)
    for warning in recording.warnings:
        click.echo(f"warning: {warning}", err=True)
    campaigns = read_campaigns(recording)
    if not campaigns:
        raise FileError(f"{path} holds no hit: no block of it completes a record")
    if "results" in task.parts:
        results = [_find_results(campaign, recording) for campaign in campaigns]
        return _write_results(task.output, [_select(item, task.samples) for item in results])
    groups = _find_groups(campaigns, task)
    if not groups:
        raise FileError(f"{path} holds none of the {' and '.join(sorted(task.parts))} wanted")
    if not task.is_split:
        channels = tuple(channel for _, group in groups for channel in group)
        write_measurement(task.output, Measurement(path, channels))
        return f"{task.output}: {len(groups)} traces in {len(channels)} channels"
    files = [task.output / name for name in _make_names([name for name, _ in groups], task.kind)]
    for file in files:
        if file.exists():
            raise FileError(f"{file} exists already: name another folder, none is overwritten")
    for file, (_, group) in zip(files, groups, strict=True):
        write_measurement(file, Measurement(path, group))
    return f"{task.output}: {len(groups)} traces in as many files"


def _find_results(campaign: ExportedCampaign, recording: Recording) -> Results:
    faults = {label.record: names for label, names in recording.faults.items()}
    return results_from_session(campaign.session.estimate_all(), faults)


def _select(results: Results, samples: Sequence[str]) -> Results:
    if not samples:
        return results
    return replace(
        results,
        samples=tuple(item for item in results.samples if item.name in samples),
        hits=tuple(hit for hit in results.hits if hit.sample in samples),
    )


def _write_results(output: Path, results: Sequence[Results]) -> str:
    if output.suffix.lower() == RESULTS_ONLY:
        contents = [results_to_json(item) for item in results]
        text = format_json(contents[0] if len(contents) == 1 else contents)
    else:
        text = format_results_table(results)
    with write_new_file(output) as part:
        part.write_text(text, "utf-8")
    count = sum(len(item.samples) for item in results)
    return f"{output}: results of {count} sample{'s' if count != 1 else ''}"


def _find_groups(campaigns: Sequence[ExportedCampaign], task: ExportTask) -> list[Group]:
    """Return what is exported, hit by hit, then mean by mean."""
    hits = [(campaign, hit) for campaign in campaigns for hit in campaign.list_hits()]
    wanted = {find_label(name, [hit.label for _, hit in hits]) for name in task.hits}
    known = {name for campaign in campaigns for name in campaign.session.names}
    for name in task.samples:
        if name not in known:
            raise ParameterError(
                f"there is no hit on {name!r}: there are some on"
                f" {', '.join(map(repr, sorted(known)))}"
            )
    groups: list[Group] = []
    if "hits" in task.parts:
        chosen = [hit for _, hit in hits if not wanted or hit.label in wanted]
        groups += [
            (hit.name, hit.make_channels(is_filtered=task.is_filtered))
            for hit in chosen
            if _is_wanted(hit, task)
        ]
    if "means" in task.parts:
        groups += [
            (f"{campaign.prefix}{name}/mean", campaign.make_mean_channels(name))
            for campaign in campaigns
            for name in campaign.session.names
            if not task.samples or name in task.samples
        ]
    return [group for group in groups if group[1]]


def _is_wanted(hit: ExportedHit, task: ExportTask) -> bool:
    if task.is_accepted_only and not hit.judged.accepted:
        return False
    return not task.samples or hit.label.sample in task.samples


def _make_names(names: Sequence[str], suffix: str) -> list[str]:
    """Return a file name for each name, all different."""
    plain = [_AWKWARD.sub("_", name) for name in names]
    return [
        f"{name}{suffix}" if plain.count(name) == 1 else f"{name}_{number}{suffix}"
        for number, name in enumerate(plain, start=1)
    ]


def _list_formats(suffixes: Sequence[str] | dict[str, str]) -> str:
    return ", ".join(suffixes)
