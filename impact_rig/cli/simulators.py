"""`impact-rig export --for`: a contact for multibody engines, and what they make of it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import click

from impact_rig.core.errors import FileError, ParameterError
from impact_rig.present.terminal.console import make_console, print_result, print_warning
from impact_rig.recordings.new_file import write_new_file
from impact_rig.results.results_file import read_results
from impact_rig.results.sample_traces import SampleTraces
from impact_rig.results.traced_campaign import TracedCampaign
from impact_rig.simulators.check import check_engine, find_obstacle
from impact_rig.simulators.contact import make_contacts
from impact_rig.simulators.parameters import ENGINES, Parameters, compute_parameters
from impact_rig.simulators.tables import tabulate_checks
from impact_rig.simulators.texts import SUFFIXES, choose_suffix, format_text

ALL = "all"
FIGURES = (".svg", ".png", ".pdf")
"""What a figure is written to."""


@dataclass(frozen=True)
class SimulatorTask:
    """What is wanted for which engines.

    Attributes
    ----------
    engines : tuple of str
        Names of `ENGINES`, or `ALL`.
    output : Path
        The file of one engine; of several the folder.
    samples : tuple of str
        Named ones: one, or none where the results have only one.
    hammer : float or None
        Of the body that strikes in its place [kg].
    speed : float or None
        At which duration and restitution are met [m/s].
    check : bool
        The engines strike, too.
    figure : Path or None
        Where their pulses are drawn.
    """

    engines: tuple[str, ...]
    output: Path
    samples: tuple[str, ...] = ()
    hammer: float | None = None
    speed: float | None = None
    check: bool = False
    figure: Path | None = None

    def __post_init__(self) -> None:
        """Refuse what cannot be done, before anything is read."""
        if len(self.samples) > 1:
            raise ParameterError("--for is for one sample: export the others apart")
        if self.figure is not None and self.figure.suffix.lower() not in FIGURES:
            raise ParameterError(
                f"{self.figure} is no picture: choose one of {', '.join(FIGURES)}"
            )
        named = [ENGINES[name] for name in self.names]
        obstacles = list(filter(None, map(find_obstacle, named)))
        if self.is_struck and len(obstacles) == len(named):
            raise ParameterError(obstacles[0])
        for file in (*self.files.values(), *([self.figure] if self.figure else [])):
            if file.exists():
                raise FileError(f"{file} exists already: name another file, none is overwritten")

    @property
    def names(self) -> tuple[str, ...]:
        """Of the engines, each once."""
        return tuple(ENGINES) if ALL in self.engines else tuple(dict.fromkeys(self.engines))

    @property
    def files(self) -> dict[str, Path]:
        """By engine."""
        if len(self.names) == 1:
            choose_suffix(self.names[0], self.output)
            return {self.names[0]: self.output}
        return {name: self.output / f"{name}{SUFFIXES[name][0]}" for name in self.names}

    @property
    def is_struck(self) -> bool:
        """Whether engines are to run."""
        return self.check or self.figure is not None


def export_to_simulators(paths: Sequence[Path], task: SimulatorTask) -> None:
    """Write the contact of one sample for engines, and print what they make of it.

    Parameters
    ----------
    paths : sequence of Path
        Recordings, results files or folders of runs: several may have several speeds.
    task : SimulatorTask
        What is wanted.

    Raises
    ------
    RigError
        If something cannot be read or written, the sample has no identified law, the speed was
        not measured, or no engine can be checked.
    """
    campaigns = [campaign for path in paths for campaign in _read_campaigns(path)]
    results = [campaign.results for campaign in campaigns]
    sample = _choose_sample(task, [item.name for found in results for item in found.samples])
    measured = make_contacts(results, sample, task.hammer)
    found = [compute_parameters(ENGINES[name], measured, task.speed) for name in task.names]
    for parameters in found:
        file = task.files[parameters.engine.name]
        with write_new_file(file) as part:
            part.write_text(format_text(parameters, file.suffix.lower()), "utf-8")
        click.echo(f"{file}: {sample} for {parameters.engine.title}")
    if task.is_struck:
        is_as_struck = task.hammer is None and task.speed is None and len(campaigns) == 1
        traces = next((item for item in campaigns[0].samples if item.name == sample), None)
        _strike(found, traces if is_as_struck else None, task)


def _read_campaigns(path: Path) -> Sequence[TracedCampaign]:
    from impact_rig.analysis.recording_analysis import analyze_recording
    from impact_rig.analysis.report_sources import find_run

    source = find_run(path)
    if not source.is_recording:
        return [TracedCampaign(read_results(source.path))]
    traced = analyze_recording(source.path, keep_traces=True, with_models=False)
    for warning in traced.warnings:
        print_warning(warning)
    return traced.campaigns


def _choose_sample(task: SimulatorTask, names: Sequence[str]) -> str:
    if task.samples:
        return task.samples[0]
    found = list(dict.fromkeys(names))
    if len(found) == 1:
        return found[0]
    raise ParameterError(f"--for needs --sample, one of {', '.join(map(repr, found)) or 'none'}")


def _strike(found: Sequence[Parameters], traces: SampleTraces | None, task: SimulatorTask) -> None:
    checks = []
    for parameters in found:
        if reason := find_obstacle(parameters.engine):
            click.echo(f"remark: {reason}", err=True)
        else:
            checks.append(check_engine(parameters))
    if task.check:
        print_result(make_console(), tabulate_checks(checks))
    if task.figure is not None:
        from impact_rig.present.figures.simulators_figure import save_simulators_figure

        with write_new_file(task.figure) as part:
            save_simulators_figure(part, task.figure.suffix.lower(), checks, traces)
        click.echo(f"{task.figure}: the pulses")
