"""The runs that a report is made of, from the names that a person gives."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from glob import glob, has_magic
from pathlib import Path
from typing import Any, TypeVar

from impact_rig.analysis.analyze import NOTHING_BY_HAND, ByHand, analyze
from impact_rig.core.given.errors import FileError, ParameterError
from impact_rig.recordings.provenance import compute_sha256
from impact_rig.recordings.run import Run
from impact_rig.results.numbers import format_count
from impact_rig.results.results_file import read_path, read_results
from impact_rig.results.traces import ReportedCampaign, TracedCampaign

_T = TypeVar("_T")
RESULTS_SUFFIX = ".json"
"""Suffix of a results file."""
RESULTS_NAME = "results.json"
"""Name of the results in a run's folder."""


@dataclass(frozen=True)
class RunSource:
    """Where a run is to be read from."""

    named: Path  # as a person named it
    run: Run | None  # its recordings; None: results alone
    results: Path  # what its results are called

    @property
    def folder(self) -> Path:
        """Where a report of it belongs."""
        return self.results.parent

    @property
    def title(self) -> str:
        """Its name: the folder of a run, else the file."""
        if self.run is not None:
            return self.run.title
        is_run = self.results.name == RESULTS_NAME
        return self.results.absolute().parent.name if is_run else self.results.stem


def list_items(given: Any) -> list[Any]:
    """Return things as a list; one may be given by itself."""
    is_one = isinstance(given, str | Path) or not isinstance(given, Iterable)
    return [given] if is_one else [*given]


def list_files(given: Any) -> list[Path]:
    """Return the files that a program names, one or several, also with wildcards.

    Raises
    ------
    RigError
        If there is none.
    """
    paths: list[Path] = []
    for item in list_items(given):
        path = read_path("files", item)
        found = [path]
        if has_magic(str(path)):
            found = [Path(name) for name in sorted(glob(str(path), recursive=True))]  # noqa: PTH207
        if not found:
            raise FileError(f"no file is called like {path}")
        paths += found
    if not paths:
        raise FileError("no file is given")
    return paths


def choose_campaign(title: str, campaigns: Sequence[_T], number: int | None) -> _T:
    """Return a campaign by its number, from 1; None: the only one.

    Raises
    ------
    RigError
        If there is none, none of this number, or there are several.
    """
    if not campaigns:
        raise FileError(f"{title} holds no complete hit")
    place = 1 if number is None and len(campaigns) == 1 else number
    if place is None or place > len(campaigns):
        raise ParameterError(
            f"{title} holds {format_count(len(campaigns), 'campaign')}: choose one with"
            f" campaign=1 to {len(campaigns)}"
        )
    return campaigns[place - 1]


def find_run(named: Path, namespace: str | None = None) -> RunSource:
    """Find what a person means by a run.

    Parameters
    ----------
    named : Path
        A recording, a results file, or the folder of a run: its recordings if there are any, else
        its results.json.
    namespace : str, optional
        Of the rig, where the recordings hold several.

    Raises
    ------
    FileError
        If there is nothing of that name, or nothing of a run in the folder.
    """
    if named.suffix == RESULTS_SUFFIX and not named.is_dir():
        return RunSource(named, None, named)
    try:
        run = Run(named, namespace)
    except FileError:
        results = named / RESULTS_NAME
        if not results.is_file():
            raise
        return RunSource(named, None, results)
    return RunSource(named, run, run.folder / RESULTS_NAME)


def read_runs(
    source: RunSource, by_hand: ByHand = NOTHING_BY_HAND
) -> tuple[ReportedCampaign, ...]:
    """Read every campaign of a source.

    A run that cannot be evaluated is described by the results beside it, if they are there, with a
    warning.

    Parameters
    ----------
    source : RunSource
        See `find_run`. Several campaigns in it are numbered.
    by_hand : ByHand
        Of hits of a recording.

    Raises
    ------
    FileError
        If neither recordings nor results can be read.
    """
    if source.run is None:
        return (_read_results_alone(source),)
    try:
        return _read_recorded(source, source.run, by_hand)
    except FileError as error:
        has_results = source.run.is_of_recorder and source.results.is_file()
        if not has_results or by_hand.accept or by_hand.reject:
            raise
        warning = f"{error}: this is the {RESULTS_NAME} beside it"
        return (_read_results_alone(replace(source, run=None), (warning,)),)


def _read_results_alone(source: RunSource, warnings: tuple[str, ...] = ()) -> ReportedCampaign:
    campaign = TracedCampaign(read_results(source.results))
    return ReportedCampaign(source.title, campaign, warnings=warnings)


def _read_recorded(source: RunSource, run: Run, by_hand: ByHand) -> tuple[ReportedCampaign, ...]:
    traced = analyze(run, by_hand=by_hand, keep_traces=True)
    many = len(traced.campaigns) > 1
    return tuple(
        ReportedCampaign(
            name=f"{source.title}, campaign {number}" if many else source.title,
            campaign=campaign,
            warnings=traced.warnings,
        )
        for number, campaign in enumerate(traced.campaigns, start=1)
    )


def find_repeated_files(paths: Sequence[Path]) -> dict[int, str]:
    """Find the files that hold what an earlier one holds: the same one, a link to it, or a copy.

    Parameters
    ----------
    paths : sequence of Path
        Files. What cannot be read or is empty is passed over: its reader names it.

    Returns
    -------
    dict of int to str
        A sentence for each place in `paths` that is to be left out.
    """
    sizes = [path.stat().st_size if path.is_file() else 0 for path in paths]
    repeated: dict[int, str] = {}
    known: dict[str, Path] = {}
    for place, path in enumerate(paths):
        if not sizes[place] or sizes.count(sizes[place]) == 1:
            continue
        try:
            digest = compute_sha256(path)
        except FileError:
            continue
        earlier = known.setdefault(digest, path)
        if earlier is not path or path in paths[:place]:
            repeated[place] = (
                f"{path} is named twice: it is used once"
                if path == earlier
                else f"{path} is left out: it is a copy of {earlier}, byte by byte"
            )
    return repeated
