"""`impact-rig import`: measurements of other instruments as a recording, without ROS."""

from pathlib import Path
from typing import Any

import click

from impact_rig.analysis.analyze import judge
from impact_rig.analysis.measured_files import MeasuredFiles, TraceSeries, make_series
from impact_rig.analysis.sources import find_repeated_files
from impact_rig.cli.output import print_taken, raise_errors
from impact_rig.core.given.errors import ParameterError, RigError
from impact_rig.files.channels import make_template
from impact_rig.files.formats.registry import read_measurement
from impact_rig.files.import_file import MeasurementOptions, read_import_template
from impact_rig.files.importing import write_imported
from impact_rig.present.console import print_warning
from impact_rig.recordings.source import SUFFIX, find_bag
from impact_rig.results.numbers import format_count


def run(
    files: tuple[Path, ...], output: Path | None, template: bool, is_shown: bool, **given: Any
) -> None:
    """Run the command; its options are declared in `commands.py`."""
    files = tuple(map(find_bag, files))
    if template:
        text = make_template(read_measurement(files[0])) if files else read_import_template()
        click.echo(text, nl=False)
        return
    if not files or output is None:
        raise click.UsageError("name the files, and the recording: FILE... -o OUT.mcap")
    if output.suffix != SUFFIX:
        raise ParameterError(f"{output} should be a recording: give it the suffix .mcap")
    series = make_series(MeasurementOptions(**given))
    raise_errors(_import_files(files, output, series, is_shown=is_shown))


def _import_files(
    files: tuple[Path, ...], output: Path, series: TraceSeries, *, is_shown: bool
) -> list[str]:
    """Write the recording; return the errors of files that are not in it."""
    repeated = find_repeated_files(files)
    paths = [path for place, path in enumerate(files) if place not in repeated]
    read = MeasuredFiles(paths, series, needs_scale=True)
    hits, errors = read.hits, [*repeated.values(), *read.errors]
    if not hits:
        return [*errors, f"no file could be used: {output} is not written"]
    print_taken(read, is_shown=is_shown)
    # How hits are judged that were cut out of a file changes no advice, and there may be many.
    judged = () if series.has_window else judge(read.events())
    found = (hit for _, _, part in judged for _, hit in part)
    reasons = {finding.reason for hit in found for finding in hit.rejections}
    for remark in (*read.warnings, *read.advise(reasons)):
        print_warning(remark)
    try:
        write_imported(output, read.setup, hits)
    except RigError as error:
        return [*errors, str(error)]
    used = {hit.path for hit in hits}
    click.echo(
        f"{output}: {format_count(len(hits), 'hit')} on {series.sample!r}, from {len(used)} of"
        f" {format_count(len(files), 'file')}"
    )
    return errors
