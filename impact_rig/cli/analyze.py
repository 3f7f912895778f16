"""`impact-rig analyze`: recordings and plain traces, without ROS."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from impact_rig.cli.quantity import Cutoff, Quantity
from impact_rig.core.errors import ParameterError, RigError
from impact_rig.core.settings import AnalysisSettings

MCAP_SUFFIX = ".mcap"
RECORDING_NAME = "session.mcap"
TRACE_ONLY = {
    "columns": "--columns",
    "rate": "--rate",
    "hammer_unit": "--hammer-unit",
    "sample_unit": "--sample-unit",
    "sample": "--sample",
    "rig_file": "--rig-file",
    "hammer_mass": "--hammer-mass",
    "sample_mass": "--sample-mass",
    "accelerometer_mass": "--accelerometer-mass",
    "hammer_stiffness": "--hammer-stiffness",
    "control": "--control",
}
"""Options that mean nothing for a recording, which explains itself."""


@dataclass(frozen=True)
class _TraceOptions:
    """The options of plain traces, as given."""

    columns: str | None
    rate: float | None
    hammer_unit: str
    sample_unit: str
    sample: str | None
    rig_file: Path | None
    hammer_mass: float | None
    sample_mass: float | None
    accelerometer_mass: float | None
    hammer_stiffness: float | None
    control: bool


@click.command(
    "analyze",
    epilog="""
    \b
    Examples:
      impact-rig analyze runs/2025-01-31T12-00-00/session.mcap
      impact-rig analyze session.mcap --json > results.json
      impact-rig analyze --cutoff off hit_1.npy hit_2.npy hit_3.npy
      impact-rig analyze --columns time,skip,hammer --hammer-unit g hit.csv
      impact-rig analyze --hammer-mass 100g --sample-mass "102.38 g" --control *.csv

    \b
    Plain traces (.npy, .csv, .txt) hold one hit of one sample each. Columns by default: hammer;
    time, hammer; time, hammer, specimen. Exit code: 2 if a file could not be used, which the
    others do not suffer from.
    """,
)
@click.argument(
    "files", nargs=-1, required=True, metavar="FILE...", type=click.Path(path_type=Path)
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON, for programs.")
@click.option(
    "--cutoff",
    type=Cutoff(),
    metavar="FREQUENCY",
    help="Low-pass, or off. [that of recording or rig file; else 50 kHz]",
)
@click.option(
    "--pulse-factor", type=float, metavar="F", help="τp = F w50: 2 versed-sine, 1.5 half-sine. [2]"
)
@click.option("--columns", metavar="ROLE,...", help="Of time, hammer, specimen, skip.")
@click.option(
    "--rate", type=Quantity("Hz", "25.6 kHz"), metavar="RATE", help="Where there is no time."
)
@click.option(
    "--hammer-unit",
    type=click.Choice(["m/s^2", "g", "N"]),
    default="m/s^2",
    help="Of the hammer's column. [m/s^2]",
)
@click.option(
    "--sample-unit",
    type=click.Choice(["m/s^2", "g"]),
    default="m/s^2",
    help="Of the sample's column. [m/s^2]",
)
@click.option("--sample", metavar="NAME", help="Which sample was struck.")
@click.option(
    "--rig-file",
    "--setup",
    "rig_file",
    type=click.Path(path_type=Path),
    help="TOML file with masses and settings; --sample is one of its samples.",
)
@click.option("--hammer-mass", type=Quantity("kg", "100 g"), metavar="MASS", help="m1.")
@click.option(
    "--sample-mass", type=Quantity("kg", "102.38 g"), metavar="MASS", help="Without accelerometer."
)
@click.option(
    "--accelerometer-mass",
    type=Quantity("kg", "3 g"),
    metavar="MASS",
    help="Carried by the sample. [0]",
)
@click.option(
    "--hammer-stiffness",
    type=Quantity("N/m", "22.5 MN/m"),
    metavar="K",
    help="k1, from an earlier control experiment.",
)
@click.option("--control", is_flag=True, help="Hammer and sample are alike: k1 = k2 = 2 k_eq.")
@click.pass_context
def command(
    context: click.Context,
    files: tuple[Path, ...],
    as_json: bool,
    cutoff: float | None,
    pulse_factor: float | None,
    **trace_options: Any,
) -> None:
    """Estimate contact time, stiffness and damping from recordings or plain traces.

    A recording (.mcap, or the folder of a run) gives the numbers of the live run, bit by bit, and
    needs no further options. Plain traces of any laboratory give contact times, and with masses
    stiffness and damping as well. No ROS is needed.
    """
    recordings = [_find_recording(path) for path in files if _is_recording(path)]
    traces = [path for path in files if not _is_recording(path)]
    if recordings and traces:
        raise ParameterError(
            f"{recordings[0]} is a recording and {traces[0]} a plain trace: analyze them apart"
        )

    def change_settings(settings: AnalysisSettings) -> AnalysisSettings:
        given = {"cutoff_frequency": cutoff, "pulse_factor": pulse_factor}
        return replace(
            settings, **{name: value for name, value in given.items() if value is not None}
        )

    if recordings:
        for name, option in TRACE_ONLY.items():
            if context.get_parameter_source(name) is not ParameterSource.DEFAULT:
                raise ParameterError(f"{option} is for plain traces: a recording explains itself")
        errors = _report_recordings(recordings, change_settings, as_json=as_json)
    else:
        options = _TraceOptions(**trace_options)
        errors = _report_traces(traces, options, change_settings, as_json=as_json)
    for error in errors[:-1]:
        click.echo(f"error: {error}", err=True)
    if errors:
        raise RigError(errors[-1])


def _is_recording(path: Path) -> bool:
    return path.suffix.lower() == MCAP_SUFFIX or path.is_dir()


def _find_recording(path: Path) -> Path:
    return path / RECORDING_NAME if path.is_dir() else path


def _report_recordings(paths: Sequence[Path], change_settings: Any, *, as_json: bool) -> list[str]:
    from impact_rig.cli.recording_analysis import analyze_recording  # noqa: PLC0415
    from impact_rig.reporting.results_file import format_json, results_to_json  # noqa: PLC0415
    from impact_rig.reporting.tables import print_results  # noqa: PLC0415
    from impact_rig.reporting.terminal import make_console  # noqa: PLC0415

    console, errors, found = make_console(), [], []
    for path in paths:
        try:
            recording = analyze_recording(path, change_settings)
        except RigError as error:
            errors.append(str(error))
            continue
        for warning in recording.warnings:
            click.echo(f"warning: {warning}", err=True)
        found += recording.campaigns
        if as_json:
            continue
        for number, campaign in enumerate(recording.campaigns, start=1):
            if len(recording.campaigns) > 1:
                console.rule(f"{path}, campaign {number}")
            elif len(paths) > 1:
                console.rule(str(path))
            print_results(console, campaign.results, campaign.setup.samples)
    if as_json and found:
        contents = [results_to_json(campaign.results) for campaign in found]
        single = len(paths) == 1 and len(contents) == 1
        click.echo(format_json(contents[0] if single else contents), nl=False)
    return errors


def _report_traces(
    paths: Sequence[Path], options: _TraceOptions, change_settings: Any, *, as_json: bool
) -> list[str]:
    from impact_rig.cli.trace_analysis import analyze_traces  # noqa: PLC0415
    from impact_rig.reporting.results_file import format_json  # noqa: PLC0415
    from impact_rig.reporting.terminal import make_console  # noqa: PLC0415
    from impact_rig.reporting.trace_results import (  # noqa: PLC0415
        print_trace_results,
        trace_results_to_json,
    )

    analyzed = analyze_traces(paths, _make_task(options, change_settings))
    if as_json:
        click.echo(format_json(trace_results_to_json(analyzed.results)), nl=False)
    elif analyzed.results.hits:
        print_trace_results(make_console(), analyzed.results)
    return list(analyzed.errors)


def _make_task(options: _TraceOptions, change_settings: Any) -> Any:
    from impact_rig.cli.trace_analysis import TraceTask  # noqa: PLC0415
    from impact_rig.recording.traces import TraceFormat, find_scale  # noqa: PLC0415

    sample, setup = _make_setup(options)
    settings = change_settings(setup.analysis if setup else AnalysisSettings())
    mass = setup.hammer_mass if setup else options.hammer_mass
    # Widths do not depend on the scale: a force without a mass is good for contact times.
    has_scale = options.hammer_unit != "N" or mass is not None
    return TraceTask(
        sample=sample,
        layout=TraceFormat(
            columns=_split_columns(options.columns),
            sampling_rate=options.rate,
            hammer_scale=find_scale(options.hammer_unit, mass) if has_scale else 1.0,
            specimen_scale=find_scale(options.sample_unit),
        ),
        settings=settings,
        setup=replace(setup, analysis=settings) if setup else None,
        hammer_stiffness=(
            math.nan if options.hammer_stiffness is None else options.hammer_stiffness
        ),
        has_scale=has_scale,
    )


def _split_columns(text: str | None) -> tuple[str, ...] | None:
    return None if text is None else tuple(role.strip() for role in text.split(","))


def _make_setup(options: _TraceOptions) -> tuple[str, Any]:
    """Return the sample's name and the masses, from the rig file or from the options."""
    from impact_rig.core.checks import check_positive  # noqa: PLC0415
    from impact_rig.core.paper import IMPACT_SPEED  # noqa: PLC0415
    from impact_rig.core.samples import RigSetup, Sample, SampleSet  # noqa: PLC0415

    if options.hammer_stiffness is not None:
        check_positive("--hammer-stiffness", options.hammer_stiffness, "N/m")
        if options.control:
            raise ParameterError("--hammer-stiffness and --control both give k1: choose one")
    masses = (options.hammer_mass, options.sample_mass, options.accelerometer_mass)
    if options.rig_file is not None:
        from impact_rig.configuration.rig_file import read_rig_file  # noqa: PLC0415

        if any(mass is not None for mass in masses) or options.control:
            raise ParameterError(
                "--rig-file gives the masses and the control sample: leave out --hammer-mass,"
                " --sample-mass, --accelerometer-mass and --control"
            )
        setup = read_rig_file(options.rig_file).setup
        if options.sample is None:
            raise ParameterError(
                "--rig-file needs --sample: which of " + ", ".join(map(repr, setup.samples.names))
            )
        setup.samples.find(options.sample)
        return options.sample, setup
    name = options.sample or "sample"
    if options.hammer_mass is not None:
        check_positive("--hammer-mass", options.hammer_mass, "kg")
    if options.hammer_mass is None or options.sample_mass is None:
        if options.control:
            raise ParameterError("--control needs both masses: --hammer-mass and --sample-mass")
        return name, None
    samples = SampleSet(
        (Sample(name, options.sample_mass),),
        control_sample=name if options.control else "",
        accelerometer_mass=options.accelerometer_mass or 0.0,
    )
    # Only the printed model depends on the impact speed, and only with a control sample.
    return name, RigSetup(samples, options.hammer_mass, IMPACT_SPEED)
