"""`impact-rig export`: hits, mean traces, results and contacts for other tools."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click

from impact_rig.cli.options import Parsed, make_quantity, refuse_given
from impact_rig.cli.simulators import ALL, SimulatorTask, export_to_simulators
from impact_rig.core.errors import FileError, ParameterError
from impact_rig.core.hits.overrule import find_label
from impact_rig.present.terminal.console import print_warning
from impact_rig.recordings.exporting import ExportedCampaign, ExportedHit, read_campaigns
from impact_rig.recordings.formats.measurement import MeasuredChannel, Measurement
from impact_rig.recordings.formats.registry import WRITABLE, write_measurement
from impact_rig.recordings.new_file import write_new_file
from impact_rig.recordings.reader import read_recording
from impact_rig.results.campaign import Results, results_from_session
from impact_rig.results.results_file import format_json, results_to_json
from impact_rig.results.results_table import format_results_table
from impact_rig.simulators.parameters import ENGINES

RESULTS_ONLY = ".json"
RESULTS_SUFFIXES = (RESULTS_ONLY, ".csv")
"""What results are written to."""
DEFAULT_PARTS = {".json": {"results"}, ".csv": {"hits"}}
"""What is exported by suffix where nothing is said: columns of text share their time, which hits
and means do not."""
OTHER_PARTS = {"hits", "means"}
TRACE_OPTIONS = {"what", "hits", "accepted_only", "filtered", "one_file_per_hit", "suffix"}
SIMULATOR_OPTIONS = {"check", "figure", "speed", "hammer"}
_AWKWARD = re.compile(r"[^\w.+-]+")
"""What file names are better without."""

Group = tuple[str, tuple[MeasuredChannel, ...]]
"""Name and channels of one hit or mean."""


@dataclass(frozen=True)
class ExportTask:
    """What is to be exported: the command's options.

    Attributes
    ----------
    output : Path
        File, or folder of one file for each hit.
    what : frozenset of str or None
        Of hits, means and results; None: as suits the format.
    samples, hits : tuple of str
        Names of those that are wanted; empty: all.
    accepted_only : bool
        Without rejected hits.
    filtered : bool
        Hits after baseline and low-pass.
    one_file_per_hit : bool
        One file for each hit or mean.
    suffix : str or None
        Of these files.
    """

    output: Path
    what: frozenset[str] | None = None
    samples: tuple[str, ...] = ()
    hits: tuple[str, ...] = ()
    accepted_only: bool = False
    filtered: bool = False
    one_file_per_hit: bool = False
    suffix: str | None = None

    def __post_init__(self) -> None:
        """Refuse what does not go together."""
        if self.suffix is not None:
            object.__setattr__(self, "suffix", "." + self.suffix.lstrip("."))
        if self.one_file_per_hit and self.suffix is None:
            raise ParameterError(
                f"--one-file-per-hit needs --format, one of {', '.join(WRITABLE)}"
            )
        if self.suffix is not None and not self.one_file_per_hit:
            raise ParameterError(
                f"--format is for --one-file-per-hit: the suffix of {self.output} tells its format"
            )
        has_results = "results" in self.parts
        formats = RESULTS_SUFFIXES if has_results else WRITABLE
        if has_results and (len(self.parts) > 1 or self.one_file_per_hit):
            raise ParameterError("results and traces do not go into the same files: export apart")
        if self.kind not in formats:
            raise ParameterError(
                f"{'results' if has_results else 'traces'} are not written to"
                f" {self.kind or 'files without a suffix'}: choose one of {', '.join(formats)}"
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
        print_warning(warning)
    campaigns = read_campaigns(recording)
    if not campaigns:
        raise FileError(f"{path} holds no hit: no block of it completes a record")
    if "results" in task.parts:
        faults = {label.record: names for label, names in recording.faults.items()}
        results = [
            results_from_session(campaign.session.estimate_all(), faults) for campaign in campaigns
        ]
        return _write_results(task.output, [_select(item, task.samples) for item in results])
    groups = _make_groups(campaigns, task)
    if not groups:
        raise FileError(f"{path} holds none of the {' and '.join(sorted(task.parts))} wanted")
    if not task.one_file_per_hit:
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


def _make_groups(campaigns: Sequence[ExportedCampaign], task: ExportTask) -> list[Group]:
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
            (hit.name, hit.make_channels(is_filtered=task.filtered))
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
    if task.accepted_only and not hit.judged.accepted:
        return False
    return not task.samples or hit.label.sample in task.samples


def _make_names(names: Sequence[str], suffix: str) -> list[str]:
    """Return a file name for each name, all different."""
    plain = [_AWKWARD.sub("_", name) for name in names]
    return [
        f"{name}{suffix}" if plain.count(name) == 1 else f"{name}_{number}{suffix}"
        for number, name in enumerate(plain, start=1)
    ]


PARTS = ("hits", "means", "results")


def parse_parts(name: str, text: str) -> frozenset[str]:
    """Return names of `PARTS`, separated by commas; raises `ParameterError`."""
    parts = frozenset(part.strip() for part in text.split(","))
    for part in parts - {*PARTS}:
        raise ParameterError(f"{name}: {part!r} is not one of {', '.join(PARTS)}")
    return parts


@click.command(
    "export",
    epilog="""
    \b
    Examples:
      impact-rig export session.mcap -o session.mat
      impact-rig export session.mcap -o brass.uff --samples "brass small" --filtered
      impact-rig export session.mcap -o hits --one-file-per-hit --format csv
      impact-rig export session.mcap -o results.csv --what results
      impact-rig export session.mcap -o results.json
      impact-rig export results.json --for mujoco --sample "steel small" -o steel.xml --check
      impact-rig export slow.mcap fast.mcap --for all --sample brass -o engines --figure pulse.png

    \b
    Channels are called "aluminium large/3.1 hammer": sample, impact and attempt, and the body, or
    "aluminium large/mean hammer". All are in m/s^2: hits as they were recorded, or after baseline
    and low-pass; in a mean, time 0 is the middle of the hammer pulse. The results are those of
    `analyze`: in CSV a row for each sample.

    \b
    For simulators the identified contact law of one sample becomes the parameters of an engine's
    own law, so that duration and restitution at the measured speed are met; comments in the file
    say what that law does not hold. Suffixes: .xml (MuJoCo), .sdf, .urdf or .yaml (Drake), .sdf
    (SDFormat), .py (PyBullet, Chrono), .adm (Adams).
    """,
)
@click.argument(
    "recordings",
    nargs=-1,
    required=True,
    metavar="RECORDING...",
    type=click.Path(path_type=Path),
)
@click.option(
    "-o",
    "--output",
    required=True,
    metavar="OUT",
    type=click.Path(path_type=Path),
    help="The file, whose suffix tells its format: .uff, .tdms, .mat, .h5, .csv or .json (results"
    " alone); with --one-file-per-hit or several simulators a folder. Nothing is overwritten.",
)
@click.option(
    "--what",
    type=Parsed(parse_parts),
    metavar="PART,...",
    help="Of hits, means and results. [results in .json, hits in .csv, else hits,means]",
)
@click.option(
    "--samples",
    "--sample",
    multiple=True,
    metavar="NAME",
    help="Only this sample. May be repeated.",
)
@click.option(
    "--hits",
    multiple=True,
    metavar="HIT",
    help="Only this hit: by record number, SAMPLE/IMPACT or SAMPLE/IMPACT.ATTEMPT. May be"
    " repeated.",
)
@click.option("--accepted-only", is_flag=True, help="Only hits that are in a mean.")
@click.option("--filtered", is_flag=True, help="Hits after baseline and low-pass.")
@click.option("--one-file-per-hit", is_flag=True, help="One file per hit or mean, in folder OUT.")
@click.option(
    "--format",
    "suffix",
    metavar="FORMAT",
    help="Of the files of --one-file-per-hit: uff, tdms, mat, h5 or csv.",
)
@click.option(
    "--for",
    "engines",
    multiple=True,
    type=click.Choice([*ENGINES, ALL]),
    help="Write the contact of a sample for this simulator. May be repeated.",
)
@click.option(
    "--check", is_flag=True, help="Let the simulators strike with it; those that are installed."
)
@click.option(
    "--figure",
    metavar="FILE",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Draw the pulse as measured, by its law and in the simulators: .svg, .png or .pdf.",
)
@click.option(
    "--speed",
    type=make_quantity("m/s", "80 mm/s"),
    metavar="SPEED",
    help="Meet duration and restitution at this one of the measured speeds, or between them.",
)
@click.option(
    "--hammer",
    type=make_quantity("kg", "100 g"),
    metavar="MASS",
    help="Another body that strikes in the simulator, by the same law.",
)
@click.pass_context
def command(
    context: click.Context,
    recordings: tuple[Path, ...],
    engines: tuple[str, ...],
    output: Path,
    samples: tuple[str, ...],
    **options: Any,
) -> None:
    """Write what a recording holds for other tools: traces of hits, their means, and results.

    RECORDING is an .mcap file, the folder of a run, or a folder as rosbag2 writes it; with --for
    a results.json as well, and several where the sample was struck at several speeds. No ROS is
    needed.
    """
    of_simulators = {name: options.pop(name) for name in SIMULATOR_OPTIONS}
    if engines:
        refuse_given(context, TRACE_OPTIONS, "is not for simulators")
        task = SimulatorTask(engines, output, samples, **of_simulators)
        export_to_simulators(recordings, task)
        return
    refuse_given(context, SIMULATOR_OPTIONS, "needs --for")
    if len(recordings) > 1:
        raise ParameterError("traces and results are exported of one recording at a time")
    click.echo(export_recording(recordings[0], ExportTask(output, samples=samples, **options)))
