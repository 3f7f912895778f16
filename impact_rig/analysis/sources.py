"""What a person names: the runs that a report is made of, and files that are named twice."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from impact_rig.analysis.analyze import analyze
from impact_rig.core.errors import FileError, ParameterError
from impact_rig.recordings.provenance import compute_sha256
from impact_rig.recordings.reader import read_recording
from impact_rig.recordings.source import RUN_NAME, find_recording
from impact_rig.results.results_file import read_results
from impact_rig.results.traces import Run, TracedCampaign

RESULTS_SUFFIX = ".json"
"""Of a results file."""
RESULTS_NAME = "results.json"
"""What a run's folder calls its results."""


@dataclass(frozen=True)
class RunSource:
    """Where a run is to be read from."""

    named: Path  # as a person named it
    path: Path  # the recording, or the results file

    @property
    def is_recording(self) -> bool:
        """Whether there are traces in it."""
        return self.path.suffix != RESULTS_SUFFIX

    @property
    def folder(self) -> Path:
        """Where a report of it belongs."""
        return self.path.parent

    @property
    def title(self) -> str:
        """What to call it: the folder of a run, else the file."""
        is_run = self.path.name == RESULTS_NAME or self.path.stem == RUN_NAME
        return self.path.absolute().parent.name if is_run else self.path.stem

    @property
    def place(self) -> str:
        """File and its folder, without where on this machine that is."""
        return str(Path(*self.path.absolute().parts[-2:]))


def find_run(named: Path) -> RunSource:
    """Find what a person means by a run.

    Parameters
    ----------
    named : Path
        A recording, a results file, or the folder of a run: its recording if there is one, else
        its results.json.

    Raises
    ------
    FileError
        If there is nothing of that name, or nothing of a run in the folder.
    """
    if named.suffix == RESULTS_SUFFIX and not named.is_dir():
        return RunSource(named, named)
    try:
        return RunSource(named, find_recording(named))
    except FileError:
        results = named / RESULTS_NAME
        if not results.is_file():
            raise
        return RunSource(named, results)


def read_runs(source: RunSource) -> tuple[Run, ...]:
    """Read every campaign of a source.

    A recording that cannot be evaluated is described by the results beside it, if they are there,
    with a warning.

    Parameters
    ----------
    source : RunSource
        See `find_run`. Several campaigns in it are numbered.

    Raises
    ------
    FileError
        If neither recording nor results can be read.
    """
    if not source.is_recording:
        return (_read_results_alone(source),)
    try:
        return _read_recorded(source)
    except FileError as error:
        beside = source.folder / RESULTS_NAME
        if source.path.stem != RUN_NAME or not beside.is_file():
            raise
        warning = f"{error}: this is the {RESULTS_NAME} beside it"
        return (_read_results_alone(RunSource(source.named, beside), (warning,)),)


def _read_results_alone(source: RunSource, warnings: tuple[str, ...] = ()) -> Run:
    results = read_results(source.path)
    try:
        samples = results.setup.samples
        for sample in results.samples:
            samples.find(sample.name)
    except ParameterError as error:
        raise FileError(f"results {source.path}: {error}") from None
    campaign = TracedCampaign(results)
    return Run(source.title, source.place, campaign, warnings=warnings)


def _read_recorded(source: RunSource) -> tuple[Run, ...]:
    traced = analyze(read_recording(source.named), keep_traces=True)
    many = len(traced.campaigns) > 1
    return tuple(
        Run(
            name=f"{source.title}, campaign {number}" if many else source.title,
            source=source.place,
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
