"""The command `impact-rig`: standard streams and the environment, then the commands."""

import io
import os
import sys
from pathlib import Path

from impact_rig.cli.commands import cli
from impact_rig.configuration.processes import open_closed_streams, use_one_thread


def _keep_standard_output() -> None:
    """Keep standard output for what Python prints: Fast DDS writes its errors there, into JSON."""
    sys.stdout.flush()
    sys.stdout = io.TextIOWrapper(
        io.BufferedWriter(io.FileIO(os.dup(1), "w")),
        encoding=sys.stdout.encoding,
        line_buffering=sys.stdout.isatty(),
    )
    os.dup2(2, 1)


def main() -> None:
    """Run the command line; never returns."""
    open_closed_streams()
    use_one_thread()
    os.environ.setdefault("HOME", str(Path.home()))  # rclpy's log folder needs it
    _keep_standard_output()
    for stream in (sys.stdout, sys.stderr):
        # A terminal without Greek letters shows question marks, not a traceback.
        stream.reconfigure(errors="replace")  # type: ignore[union-attr]
    cli(prog_name="impact-rig")


if __name__ == "__main__":
    main()
