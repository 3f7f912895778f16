"""Spoilt recordings are read, or refused in one sentence: never a crash, a hang, or all memory."""

import json
import os
import subprocess
import sys
from pathlib import Path

COPIES = 60
"""Of each of three recordings."""


def test_spoilt_recordings_are_read_or_refused_in_a_sentence(make_recording, tmp_path):
    recordings = []
    for compression in ("zstd", "lz4", "none"):
        maker = make_recording(f"{compression}.mcap", compression=compression, chunk_size=2000)
        maker.writer.add_metadata("impact_rig", {"notes": "cold"})
        maker.add_setup()
        for record in range(1, 5):
            maker.add_virtual_impact(record, "overload")
            maker.add_block(record)
        maker.writer.add_attachment("rig.toml", "application/toml", bytes(500), 1)
        recordings.append(str(maker.close()))
    script = Path(__file__).with_name("read_mutations.py")
    child = subprocess.run(
        [sys.executable, str(script), str(tmp_path), str(COPIES), *recordings],
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
    assert child.returncode == 0, child.stderr
    outcomes = json.loads(child.stdout)
    assert set(outcomes) == {"read", "error"}
    assert outcomes["read"] + outcomes["error"] == 3 * COPIES
    assert min(outcomes.values()) > COPIES / 4
