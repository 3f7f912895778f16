"""`impact-rig export`: hits, mean traces, results and contacts for other tools."""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click

from impact_rig.analysis.hits import ExportedCampaign, make_channels, read_campaigns
from impact_rig.analysis.sources import RunSource, find_run, read_runs
from impact_rig.cli.info import EXIT_DAMAGED, describe_hits
from impact_rig.cli.options import refuse_given
from impact_rig.cli.output import show_progress
from impact_rig.core.given.errors import FileError, ParameterError
from impact_rig.core.hit.overrules import find_label
from impact_rig.files.formats.registry import WRITABLE, write_measurement
from impact_rig.files.measurement import MeasuredChannel, Measurement
from impact_rig.present.console import print_warning
from impact_rig.recordings.contents import recover_run
from impact_rig.recordings.new_file import write_new_file
from impact_rig.recordings.run import Run
from impact_rig.recordings.source import SUFFIX
from impact_rig.results.campaign import Results
from impact_rig.results.numbers import format_count
from impact_rig.results.results_file import format_results_table, results_to_json
from impact_rig.results.wire import format_json
from impact_rig.simulators.engines import ENGINES, format_contact, make_contact

RESULTS_SUFFIXES = (".json", ".csv")  # formats of results
# Columns of text share their time, but hits and means do not.
DEFAULT_PARTS = {".json": {"results"}, ".csv": {"hits"}}
TRACES = {"hits", "means"}
TRACE_OPTIONS = {"what", "hits", "accepted_only", "filtered", "suffix"}
AWKWARD = re.compile(r"[^\w.+-]+")  # what is replaced in file names

Group = tuple[str, tuple[MeasuredChannel, ...]]
"""Name and channels of one hit or mean."""


class Traces(Sequence[MeasuredChannel]):
    """The channels of many hits, made hit by hit each time they are gone through."""

    def __init__(self, make_groups: Callable[[], Iterator[Group]]) -> None:
        self._make_groups = make_groups
        self.names = [(name, len(channels)) for name, channels in make_groups()]

    def __iter__(self) -> Iterator[MeasuredChannel]:
        """Yield them, with those of one hit in memory."""
        return (channel for _, group in self._make_groups() for channel in group)

    def __len__(self) -> int:
        """Return how many there are."""
        return sum(count for _, count in self.names)

    def __getitem__(self, place: Any) -> Any:
        """Return one, or some of them."""
        return tuple(self)[place]


@dataclass(frozen=True)
class ExportTask:
    """Options of the command: the content to export."""

    output: Path  # file, or folder of one file for each hit or mean
    what: str | None = None  # one of hits, means and results; None: as suits the format
    samples: tuple[str, ...] = ()  # empty: all
    hits: tuple[str, ...] = ()  # empty: all
    accepted_only: bool = False
    filtered: bool = False
    suffix: str | None = None  # of one file for each hit or mean

    def __post_init__(self) -> None:
        """Refuse a format that does not suit what is exported."""
        is_results = "results" in self.parts
        kind = self.output.suffix.lower() if is_results else self.kind
        formats = RESULTS_SUFFIXES if is_results else WRITABLE
        if kind not in formats:
            raise ParameterError(
                f"{'results' if is_results else 'traces'} are not written to"
                f" {kind or 'files without a suffix'}: choose one of {', '.join(formats)}"
            )

    @property
    def kind(self) -> str:
        """Suffix of what is written."""
        return f".{self.suffix.lstrip('.')}" if self.suffix else self.output.suffix.lower()

    @property
    def parts(self) -> set[str]:
        """The exported content."""
        if self.what:
            return {self.what}
        return {"hits"} if self.hits else DEFAULT_PARTS.get(self.kind, TRACES)


def export_run(source: RunSource, task: ExportTask) -> str:
    """Export a run; return a sentence on what was written.

    Raises
    ------
    FileError
        If the recording cannot be read, holds no such hit or mean, or a file exists already
        or cannot be written.
    ParameterError
        If there is no such sample or hit.
    """
    if "results" in task.parts:
        results = [_select(item, task.samples) for item in _read_results(source)]
        return _write_results(task.output, results)
    path, recorded = source.named, source.run
    if recorded is None:
        raise FileError(f"{path} holds results alone: hits and means are in a recording")
    reading = recorded.events()
    campaigns = read_campaigns(reading)
    for warning in reading.warnings:
        print_warning(warning)
    groups = _choose_groups(campaigns, task)
    traces = Traces(groups)
    if not traces:
        raise FileError(f"{path} holds no such {' or '.join(sorted(task.parts))}")
    if task.suffix is None:
        write_measurement(task.output, Measurement(path, traces))
        return f"{task.output}: {len(traces.names)} traces in {len(traces)} channels"
    files = [
        task.output / f"{number:04}_{AWKWARD.sub('_', name)}{task.kind}"
        for number, (name, _) in enumerate(traces.names, start=1)
    ]
    for file in files:
        if file.exists():
            raise FileError(f"{file} exists already: name another folder")
    for file, (_, group) in zip(files, groups(), strict=True):
        write_measurement(file, Measurement(path, group))
    return f"{task.output}: {len(files)} traces in as many files"


def export_contact(source: RunSource, name: str, output: Path, samples: Sequence[str]) -> str:
    """Write the contact of one sample for a simulator; return a sentence on what was written.

    Parameters
    ----------
    source : RunSource
        See `find_run`.
    name : str
        Of the simulator, of `ENGINES`.
    output : Path
        The file.
    samples : sequence of str
        The sample; empty where the results have only one.

    Raises
    ------
    RigError
        If something cannot be read or written, or the sample has no identified contact law.
    """
    engine = ENGINES[name]
    if output.suffix.lower() != engine.suffix:
        raise ParameterError(f"{output} is not a file of {engine.title}: it has {engine.suffix}")
    results, *others = _read_results(source)
    if others:
        raise FileError(f"{source.named} holds {1 + len(others)} campaigns: --for is for one")
    names = samples or [item.name for item in results.samples]
    if len(names) != 1:
        choice = ", ".join(map(repr, names)) or "none"
        raise ParameterError(f"--for is for one sample: name it with --sample, of {choice}")
    text = format_contact(engine, make_contact(results, names[0]))
    with write_new_file(output) as part:
        part.write_text(text, "utf-8")
    return f"{output}: {names[0]} for {engine.title}"


def _read_results(source: RunSource) -> list[Results]:
    """Return the results of each campaign, and print warnings."""
    runs = read_runs(source)
    for warning in runs[0].warnings:
        print_warning(warning)
    return [run.campaign.results for run in runs]


def _select(results: Results, samples: Sequence[str]) -> Results:
    if not samples:
        return results
    return replace(
        results,
        samples=tuple(item for item in results.samples if item.name in samples),
        hits=tuple(hit for hit in results.hits if hit.sample in samples),
    )


def _write_results(output: Path, results: Sequence[Results]) -> str:
    if output.suffix.lower() == ".json":
        contents = [results_to_json(item) for item in results]
        text = format_json(contents[0] if len(contents) == 1 else contents)
    else:
        text = format_results_table(results)
    with write_new_file(output) as part:
        part.write_text(text, "utf-8")
    count = sum(len(item.samples) for item in results)
    return f"{output}: results of {format_count(count, 'sample')}"


def _choose_groups(
    campaigns: Sequence[ExportedCampaign], task: ExportTask
) -> Callable[[], Iterator[Group]]:
    """Return what yields the exported content, hit by hit, then mean by mean."""
    labels = [hit.label for campaign in campaigns for _, hit in campaign.records]
    wanted = {find_label(name, labels) for name in task.hits}
    known = {name for campaign in campaigns for name in campaign.session.names}
    for name in task.samples:
        if name not in known:
            raise ParameterError(
                f"there is no hit on {name!r}: there are some on"
                f" {', '.join(map(repr, sorted(known)))}"
            )

    def make_all() -> Iterator[Group]:
        for campaign in campaigns if "hits" in task.parts else ():
            for hit in campaign.list_hits():
                if (
                    (not wanted or hit.label in wanted)
                    and (not task.samples or hit.sample in task.samples)
                    and (hit.accepted or not task.accepted_only)
                ):
                    yield hit.title, make_channels(hit, is_filtered=task.filtered)
        for campaign in campaigns if "means" in task.parts else ():
            for name in campaign.session.names:
                if not task.samples or name in task.samples:
                    yield f"{campaign.prefix}{name}/mean", campaign.make_mean_channels(name)

    return lambda: (group for group in make_all() if group[1])


def save_sound_copy(run: Run, output: Path) -> None:
    """Write the sound part of a run to a new recording, and print what is lost.

    Raises as `recover_run`.
    """
    with show_progress() as follow:
        total = 2 * run.size  # it is read twice
        contents = recover_run(
            run, output, report=lambda done: follow(f"reading {run.path}", done, total)
        )
    if (part := run.describe_part()) is not None:
        print_warning(part)
    for problem in contents.problems:
        print_warning(f"{run.path}: {problem}")
    lost = [f"{contents.unread} bytes"] if contents.unread else []
    if contents.lost:
        lost.append(f"at least {format_count(contents.lost, 'message')}")
    click.echo(f"{output}: {describe_hits(contents)}; lost: {' and '.join(lost) or 'nothing'}")
    if not contents.is_sound:
        raise SystemExit(EXIT_DAMAGED)


def run(
    recording: Path,
    engine: str | None,
    output: Path,
    samples: tuple[str, ...],
    namespace: str | None,
    **options: Any,
) -> None:
    """Run the command; its options are declared in `commands.py`."""
    if engine:
        refuse_given(TRACE_OPTIONS, "is not for simulators")
        click.echo(export_contact(find_run(recording, namespace), engine, output, samples))
    elif output.suffix == SUFFIX:
        refuse_given(TRACE_OPTIONS | {"samples"}, f"is not for {SUFFIX}: all is copied")
        save_sound_copy(Run(recording, namespace), output)
    else:
        task = ExportTask(output, samples=samples, **options)
        click.echo(export_run(find_run(recording, namespace), task))
