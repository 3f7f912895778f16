"""`impact-rig import`: measurements of other instruments as a recording, without ROS."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from impact_rig.analysis.measured_files import TraceSeries, make_series
from impact_rig.cli import options
from impact_rig.cli.each_file import raise_errors
from impact_rig.core.errors import ParameterError, RigError
from impact_rig.present.terminal.console import print_warning
from impact_rig.results.numbers import format_count

RECORDING_SUFFIX = ".mcap"


def _print_template(context: click.Context, _parameter: click.Parameter, value: bool) -> None:
    if not value or context.resilient_parsing:
        return
    from impact_rig.configuration.import_file import read_import_template

    click.echo(read_import_template(), nl=False)
    context.exit()


@click.command(
    "import",
    epilog="""
    \b
    Examples:
      impact-rig import hit_*.lvm -o hits.mcap --sample "brass small"
      impact-rig import *.npy -o hits.mcap --hammer-unit N --hammer-mass 1kg
      impact-rig import run.tdms -o hits.mcap --hammer ai0 --specimen ai1 \\
          --hammer-sensitivity "10 mV/g" --sample-sensitivity "100 mV/g"
      impact-rig import --template > bench.toml
      impact-rig import run/*.csv -o hits.mcap --channels bench.toml

    \b
    Each file is one hit, in the order given: LabVIEW .lvm, .tdms, UFF 58, .mat, text, .npy, .wav,
    HDF5. Numbers are kept as they are in the file, bit by bit, with the calibration beside them.
    A force hammer's channel becomes acceleration by its mass.

    \b
    A hit was when its file says so: .lvm (without a time zone: taken as UTC), .tdms, and .mat and
    HDF5 of impact-rig export. Where a file does not, or names a time before the end of the hit
    before, the hit comes a second after that end, the first one a second into 1970. The same
    files make the same recording. Exit code: 2 if a file could not be used, which the others do
    not suffer from.
    """,
)
@options.files_argument
@click.option(
    "-o",
    "--output",
    required=True,
    metavar="OUT.mcap",
    type=click.Path(path_type=Path),
    help="The recording; it must not exist.",
)
@click.option(
    "--template",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_print_template,
    help="Print a file for --channels, with comments, and stop.",
)
@options.measurement_options
def command(
    files: tuple[Path, ...], output: Path, traces: Mapping[str, Any], settings: Mapping[str, Any]
) -> None:
    """Make a recording of other instruments' files, one hit each, all of one sample.

    `analyze`, `replay` and the tools of others take it as one of the rig's own.
    """
    if output.suffix != RECORDING_SUFFIX:
        raise ParameterError(f"{output} should be a recording: give it the suffix .mcap")
    errors = _import_files(files, output, make_series(traces, settings))
    raise_errors(errors)


def _import_files(files: tuple[Path, ...], output: Path, series: TraceSeries) -> list[str]:
    """Write the recording; return what is wrong with files that are not in it."""
    from impact_rig.analysis.measured_files import join_errors, read_series
    from impact_rig.analysis.repeated_files import find_repeated_files
    from impact_rig.recordings.importing import write_imported

    repeated = find_repeated_files(files)
    paths = [path for place, path in enumerate(files) if place not in repeated]
    hits, setup, broken, remarks = read_series(paths, series, needs_scale=True)
    errors = [*repeated.values(), *join_errors(broken)]
    if not hits:
        return [*errors, f"none of the files could be used: {output} is not written"]
    for remark in remarks:
        print_warning(remark)
    try:
        write_imported(output, setup, hits)
    except RigError as error:
        return [*errors, str(error)]
    used = {hit.path for hit in hits}
    click.echo(
        f"{output}: {format_count(len(hits), 'hit')} on {series.sample!r}, from {len(used)} of"
        f" {format_count(len(files), 'file')}"
    )
    return errors
