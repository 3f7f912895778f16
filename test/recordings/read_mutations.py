"""Reads spoilt copies of recordings in a process with little memory and time.

Called with the folder to work in, how many copies are made of each, and the recordings; prints
how many could be read to their end, and how many gave an error that a person can read.
"""

import collections
import json
import resource
import signal
import sys
from pathlib import Path

from bench.damage import mutate

from impact_rig.core.errors import FileError
from impact_rig.recordings.reader import read_recording
from impact_rig.recordings.records import Attachment, MetadataRecord
from impact_rig.recordings.scan import Scan
from impact_rig.recordings.source import open_source

MEMORY = 1 << 30
"""For all that the process maps [byte]: its libraries take half of it."""
TIME = 20
"""For one copy [s]: a thousand times what it takes."""


def read_all(path: Path) -> None:
    source = open_source(path)
    source.read_channels()
    for _ in Scan(path, kinds=frozenset({MetadataRecord, Attachment})).read():
        pass
    recording = read_recording(path)
    for _ in recording.events():
        pass


def main(folder: str, copies: str, *recordings: str) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    outcomes: collections.Counter[str] = collections.Counter()
    spoilt = Path(folder) / "spoilt.mcap"
    for recording in recordings:
        good = Path(recording).read_bytes()
        for seed in range(int(copies)):
            spoilt.write_bytes(mutate(good, seed))
            signal.alarm(TIME)  # a hang ends the process
            try:
                read_all(spoilt)
                outcomes["read"] += 1
            except FileError as error:
                is_clear = str(spoilt) in str(error) and str(error).isprintable()
                outcomes["error" if is_clear else str(error)] += 1
            signal.alarm(0)
    print(json.dumps(outcomes))


if __name__ == "__main__":
    main(*sys.argv[1:])
