"""A campaign on a device of openDAQ: server, packets and streaming are a stranger's."""

import json
import math
import os
import shutil
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest
from terminal import Terminal

from impact_rig.core.given.records import HitLabel
from impact_rig.recordings.messages import count_points
from impact_rig.recordings.scan import Scan
from impact_rig.recordings.schemas import decode_message

RIG = (sys.executable, "-m", "impact_rig.cli.main")
TEST_FOLDER = Path(__file__).parents[1]
SAMPLES = ("aluminium large", "steel small")
IMPACTS = 5
SEED = 7
RATE = 1e6

pytest.importorskip("opendaq", reason="pip install opendaq")

from fakes.opendaq_bench import make_rig  # noqa: E402 - it needs openDAQ


@contextmanager
def run_bench(folder):
    """Run the device on a network of its own; yield the program, and what leads in there."""
    tools = ("unshare", "nsenter", "ip")
    if os.geteuid() or not all(map(shutil.which, tools)):
        pytest.skip(f"a network of its own needs root and {', '.join(tools)}")
    with subprocess.Popen(
        ["unshare", "--net", sys.executable, "-m", "fakes.opendaq_bench", folder, str(SEED)],
        cwd=TEST_FOLDER, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    ) as bench:  # fmt: skip
        number = bench.stdout.readline().strip()
        yield bench, ("nsenter", f"--net=/proc/{number}/ns/net")
        bench.stdin.close()


def read_processor_time(rig) -> float:
    """Return the processor time of the accelerometer node so far [s]."""
    pid = rig.text.partition("accelerometer started (pid=")[2].partition(")")[0]
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def test_every_hit_comes_through_and_no_block_of_the_stream_is_lost(
    environment, tmp_path, strike, record_property
):
    with (
        run_bench(tmp_path) as (bench, enter), Terminal([
            *enter, *RIG, "up", "--output", tmp_path, "--no-visualizer", "--continuous",
            "--record-stream", "--rig-file", tmp_path / "bench.toml",
            "--set", "hammer.swing_time=0.02", "--set", "hammer.lead_time=0.1",
            "--set", "accelerometer.trigger_timeout=20.0",
            "--set", "campaign.verdict_timeout=30.0",
        ], environment) as rig,
        Terminal([
            *enter, *RIG, "campaign", "--output", tmp_path,
            *(word for name in SAMPLES for word in ("--sample", name)), "--impacts", IMPACTS,
            "--wait", "60 s",
        ], environment) as campaign,
    ):  # fmt: skip
        rig.wait_for("ready: ")
        for name in SAMPLES:
            campaign.wait_for(f"Mount {name}, and press Enter", 0)
            bench.stdin.write(f"{name}\n")
            bench.stdin.flush()
            campaign.write("\n")
        assert campaign.wait() == 0, campaign.text + rig.text
        used = read_processor_time(rig)
        rig.interrupt()
        rig.wait()
    results = json.loads((tmp_path / "results.json").read_text("utf-8"))
    assert [hit["accepted"] for hit in results["hits"]] == [True] * (len(SAMPLES) * IMPACTS)
    assert all(hit["origin_source"].startswith("openDAQ device") for hit in results["hits"])
    # The light barrier is a third signal, of which the record holds the value alone.
    bench_rig = make_rig(SEED)
    for hit in results["hits"]:
        label = HitLabel(hit["sample"], hit["impact"], hit["impact"])
        wanted, standard = (hit[f"impact_speed_{kind}m_per_s"] for kind in ("", "u_"))
        assert wanted == pytest.approx(bench_rig.strike(label).speed.value, rel=1e-3)
        assert 0.0 < standard < 0.01 * wanted
    seconds = check_stream(tmp_path / "session.mcap")
    record_property("processor seconds per second of the stream", round(used / seconds, 3))
    virtual = {item.name: item for item in strike(SAMPLES, impacts=IMPACTS, seed=SEED).samples}
    for sample in results["samples"]:
        for name, unit in (("contact_time", "s"), ("stiffness", "n_per_m")):
            wanted = getattr(virtual[sample["name"]].paper, name)
            found, spread = sample[f"{name}_{unit}"], sample[f"{name}_expanded_{unit}"]
            assert abs(found - wanted.value) <= math.hypot(wanted.expanded, spread)


def check_stream(path) -> float:
    """Require all blocks of the running stream, one behind the other; return its length [s]."""
    found = Scan(path).read_messages(lambda channel: channel.topic == "/acceleration/stream")
    blocks = [(block.first_sample, count_points(block)) for block in map(decode_message, found)]
    ends = [place + count for place, count in blocks]
    assert [place for place, _ in blocks[1:]] == ends[:-1], "a block is missing"
    return (ends[-1] - blocks[0][0]) / RATE
