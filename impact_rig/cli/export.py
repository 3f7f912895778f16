"""`impact-rig export`: hits, mean traces and results of a recording for other tools."""

from pathlib import Path

import click

from impact_rig.cli.recordings.export_task import ExportTask, export_recording

PARTS = ("hits", "means", "results")


class _Parts(click.ParamType):
    """Names of `PARTS`, separated by commas."""

    name = "parts"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> frozenset[str]:
        """Return the names."""
        parts = [part.strip() for part in str(value).split(",")]
        for part in parts:
            if part not in PARTS:
                self.fail(f"{part!r} is not one of {', '.join(PARTS)}", param, ctx)
        return frozenset(parts)


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

    \b
    Channels are called "aluminium large/3.1 hammer": sample, impact and attempt, and the body, or
    "aluminium large/mean hammer". All are in m/s^2: hits as they were recorded, or after baseline
    and low-pass; in a mean, time 0 is the middle of the hammer pulse. The results are those of
    `analyze`: in CSV a row for each sample.
    """,
)
@click.argument("recording", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    required=True,
    metavar="OUT",
    type=click.Path(path_type=Path),
    help="The file, whose suffix tells its format: .uff, .tdms, .mat, .h5, .csv or .json (results"
    " alone); with --one-file-per-hit a folder. Nothing is overwritten.",
)
@click.option(
    "--what",
    type=_Parts(),
    metavar="PART,...",
    help="Of hits, means and results. [results in .json, hits in .csv, else hits,means]",
)
@click.option(
    "--samples", multiple=True, metavar="NAME", help="Only this sample. May be repeated."
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
def command(
    recording: Path,
    output: Path,
    what: frozenset[str] | None,
    samples: tuple[str, ...],
    hits: tuple[str, ...],
    accepted_only: bool,
    filtered: bool,
    one_file_per_hit: bool,
    suffix: str | None,
) -> None:
    """Write what a recording holds for other tools: traces of hits, their means, and results.

    RECORDING is an .mcap file, the folder of a run, or a folder as rosbag2 writes it. No ROS is
    needed.
    """
    task = ExportTask(
        output=output,
        what=what,
        samples=samples,
        hits=hits,
        is_accepted_only=accepted_only,
        is_filtered=filtered,
        is_split=one_file_per_hit,
        suffix=None if suffix is None else "." + suffix.lstrip("."),
    )
    click.echo(export_recording(recording, task))
