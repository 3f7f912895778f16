"""`python3 -m bench [PART ...]`: measure what is claimed, on this machine.

The exit code is 0 if all goals are reached, 1 if one is missed, 2 if a part could not be measured.
"""

import argparse
import importlib
import signal
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from bench import PARTS
from bench.measure import FULL, Bench, Extent, Figure, NotHereError
from impact_rig.core.given.errors import RigError


def run_part(
    name: str, extent: Extent, campaigns: Path, beside: Path | None = None
) -> list[Figure]:
    """Measure one part in an empty folder, and print each figure beside its goal."""
    figures = []
    started = time.perf_counter()
    module, title = PARTS[name]
    measure = getattr(importlib.import_module(f"bench.{module}"), f"measure_{name}")
    with tempfile.TemporaryDirectory(prefix=f"impact_rig_{name}_") as folder:
        print(f"{name}: {title}", file=sys.stderr)
        for figure in measure(Bench(Path(folder), extent, campaigns, beside)):
            figures.append(figure)
            print(figure, flush=True)
    print(f"{name} took {time.perf_counter() - started:.1f} s", file=sys.stderr)
    return figures


def main(words: list[str] | None = None) -> int:
    """Measure the parts that were asked for, all by default; return the exit code."""
    parser = argparse.ArgumentParser("bench", description="Measure what is claimed.")
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--full", action="store_true", help="50 faults, 2000 damaged files ...")
    extents = ("seconds", "kills", "mutations", "seed")
    for name in extents:
        parser.add_argument(f"--{name}", type=int, metavar="N")
    parser.add_argument(
        "--beside", type=Path, metavar="PATH", help="another checkout, set up: demos in turn"
    )
    given = parser.parse_args(words)
    if unknown := set(given.parts) - set(PARTS):
        parser.error(f"there is no part {min(unknown)!r}: choose of {', '.join(PARTS)}")
    numbers = {name: value for name in extents if (value := getattr(given, name)) is not None}
    extent = replace(FULL if given.full else Extent(), **numbers)
    found: list[Figure] = []
    errors = []
    with tempfile.TemporaryDirectory(prefix="impact_rig_campaigns_") as folder:
        for name in given.parts or PARTS:
            try:
                found += run_part(name, extent, Path(folder), given.beside)
            except NotHereError as error:
                print(f"{name} is left out: {error}", file=sys.stderr)
            except (RigError, ModuleNotFoundError) as error:
                errors.append(f"{name} could not be measured: {error}")
    missed = [figure for figure in found if figure.is_missed]
    for line in (*map(str, missed), *errors):
        print(line, file=sys.stderr)
    return 2 if errors else int(bool(missed))


if __name__ == "__main__":
    # SIGTERM ends the bench as Ctrl-C does: with every process that it has started.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    sys.exit(main())
