"""Reads spoilt recordings, one after the other, with bounded memory; a process of its own.

Called with a folder that holds the good recordings, the first seed and how many. Prints a line of
JSON before and after each spoilt recording, so that who listens knows what hung or crashed.
"""

import json
import resource
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

from impact_rig.bench.mutations import mutate
from impact_rig.core.errors import RigError
from impact_rig.core.session import Session
from impact_rig.core.setup.samples import RigSetup
from impact_rig.recording.reading.mcap_reader import read_recording
from impact_rig.recording.reading.source import SUFFIX
from impact_rig.recording.recovery.inspection import inspect_recording
from impact_rig.recording.recovery.recovery import recover_recording

MEMORY_LIMIT = 1 << 30
"""What reading may take beside the program itself [byte], our choice: a thousand times the
recordings that are spoilt."""
PAGE_FILE = Path("/proc/self/statm")


def read(path: Path) -> None:
    """Read all set-ups and blocks, as `analyze` does first."""
    for _ in read_recording(path).events():
        pass


def analyze(path: Path) -> None:
    """Find and judge the hits; what is estimated from them afterwards knows no files."""
    session: Session | None = None
    for event in read_recording(path).events():
        if isinstance(event, RigSetup):
            session = Session(event)
        elif session is not None:
            session.feed(event)


def inform(path: Path) -> None:
    """Find what `info` tells."""
    inspect_recording(path)


def recover(path: Path) -> None:
    """Make a good recording of it, as `recover` does; that one must be readable."""
    output = path.with_name(f"recovered{SUFFIX}")
    output.unlink(missing_ok=True)
    recovery = recover_recording(path, output)
    if recovery.output is not None and not inspect_recording(recovery.output).is_sound:
        raise ValueError("the recovered recording is not sound")


OPERATIONS: dict[str, Callable[[Path], None]] = {
    "read": read,
    "analyze": analyze,
    "info": inform,
    "recover": recover,
}


def try_operation(operation: Callable[[Path], None], path: Path) -> str:
    """Return how it ended: "read", "refused" in one sentence, "no memory", or the fault."""
    try:
        operation(path)
    except RigError:
        return "refused"
    except MemoryError:
        return "no memory"
    except Exception as error:  # noqa: BLE001 - whatever it is, it is what the bench looks for
        return f"{type(error).__name__}: {error}"
    return "read"


def limit_memory() -> None:
    """Let this process have `MEMORY_LIMIT` more than it has, and no more."""
    pages = int(PAGE_FILE.read_text("ascii").split()[0])
    limit = pages * resource.getpagesize() + MEMORY_LIMIT
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


def main(folder: str, first: str, count: str) -> None:
    """Spoil and read."""
    originals = [path.read_bytes() for path in sorted(Path(folder).glob(f"*{SUFFIX}"))]
    work = Path(folder, "work")
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir()
    path = work / f"spoilt{SUFFIX}"
    limit_memory()
    for seed in range(int(first), int(first) + int(count)):
        print(json.dumps({"seed": seed}), flush=True)
        path.write_bytes(mutate(originals[seed % len(originals)], seed))
        outcomes = {name: try_operation(work, path) for name, work in OPERATIONS.items()}
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        print(json.dumps({"seed": seed, "outcomes": outcomes, "peak_kib": peak}), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
