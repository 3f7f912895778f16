"""The parts `start`, `demo`, `latency` and `stop`, on little, and what processes tell."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from mcap.writer import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from bench import running
from bench.measure import Bench
from bench.rig_processes import Said
from bench.running import Chain
from impact_rig.core.errors import RigError


def test_a_process_is_timed_to_its_end() -> None:
    assert running.run_python(("-c", "import time; time.sleep(0.2)")) > 0.2


def test_help_and_every_node_are_measured(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("rclpy", reason="the nodes need ROS 2")
    started: list[str] = []

    def run(words: tuple[str, ...]) -> float:
        started.append(words[-1])
        return float(len(started))

    monkeypatch.setattr(running, "run_python", run)
    helps, empties, *nodes = running.measure_start(bench)
    assert str(helps.goal) == "at most 0.3"
    assert (len(helps.values), len(empties.values)) == (bench.extent.repeats,) * 2
    names = {"hammer", "accelerometer", "estimator", "campaign", "recorder", "visualizer"}
    assert {figure.name.split(",")[0] for figure in nodes} == names
    assert {"import impact_rig.nodes." + name for name in names} < set(started)
    assert {len(figure.values) for figure in nodes} == {running.IMPORTS}


def test_without_ros_it_is_said_what_is_missing(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(running.importlib.util, "find_spec", lambda _: None)
    with pytest.raises(ModuleNotFoundError) as caught:
        list(running.measure_start(bench))
    assert caught.value.name == "rclpy"


def test_every_campaign_is_timed(bench: Bench) -> None:
    (figure,) = running.measure_demo(bench)
    assert figure.values == (1.5,) * bench.extent.demos
    assert (figure.unit, str(figure.goal)) == ("s", "at most 20")


MILLI = 1_000_000
DEFINITIONS = {
    "/release": "uint32 record\nstring sample\nfloat64 swing_time",
    "/acceleration": "uint32 record\nbool last",
    "/recorder/stored": "uint32 record\nbool complete",
    "/impact": "uint32 record",
    "/estimate": "string name",
}
"""The fields that matter, of messages of these topics."""


def write_messages(path: Path, messages: list[tuple[str, int, dict[str, Any]]]) -> None:
    """Write messages as topic, publish time and fields, in this order."""
    store = get_typestore(Stores.EMPTY)
    names = {topic: f"test/msg/T{number}" for number, topic in enumerate(DEFINITIONS)}
    for topic, text in DEFINITIONS.items():
        store.register(get_types_from_msg(text, names[topic]))
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2", "test")
        channels = {}
        for topic, text in DEFINITIONS.items():
            schema = writer.register_schema(names[topic], "ros2msg", text.encode())
            channels[topic] = writer.register_channel(topic, "cdr", schema)
        for number, (topic, moment, fields) in enumerate(messages):
            content = store.types[names[topic]](**fields)
            data = bytes(store.serialize_cdr(content, names[topic]))
            writer.add_message(channels[topic], number, data, moment)
        writer.finish()


def test_each_hit_is_followed_from_release_to_estimate(tmp_path: Path) -> None:
    path = tmp_path / "session.mcap"
    write_messages(
        path,
        [
            ("/release", 100, {"record": 1, "sample": "a", "swing_time": 1e-6}),
            ("/estimate", 900, {"name": "a"}),
            ("/acceleration", 1200, {"record": 1, "last": False}),
            ("/acceleration", 1300, {"record": 1, "last": True}),
            ("/recorder/stored", 1350, {"record": 1, "complete": False}),
            # Topics reach the recorder in any order.
            ("/impact", 1500, {"record": 1}),
            ("/recorder/stored", 1400, {"record": 1, "complete": True}),
            ("/estimate", 1700, {"name": "a"}),
            ("/estimate", 1600, {"name": "b"}),
            ("/release", 2000, {"record": 2, "sample": "a", "swing_time": 0.0}),
        ],
    )
    assert running.read_chains(path) == [Chain(1100, 1300, 1400, 1500, 1700)]


def test_the_first_moment_not_before_another_is_found() -> None:
    assert running.find_first([10, 20, 30], 20) == 20
    assert running.find_first([10, 20, 30], 21) == 30
    assert running.find_first([10], 11) is None


def make_chain(start: int, whole: int) -> Chain:
    return Chain(start, start + 1 * MILLI, start + 3 * MILLI, start + 6 * MILLI, start + whole)


def test_steps_add_up_to_the_whole(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    chains = [make_chain(number * 100 * MILLI, 10 * MILLI) for number in range(98)]
    chains += [make_chain(10**10, 50 * MILLI)] * 2
    monkeypatch.setattr(running, "read_chains", lambda _: chains)
    whole, tail, *steps = running.measure_latency(bench)
    assert (len(whole.values), whole.median, whole.is_reached) == (200, 10.0, True)
    assert (tail.median, tail.is_reached) == (50.0, False)
    assert [figure.median for figure in steps] == [1.0, 2.0, 3.0, 4.0]
    assert str(whole.goal) == "at most 15"
    assert str(tail.goal) == "at most 40"


def test_a_recording_without_a_whole_chain_is_refused(bench: Bench) -> None:
    with pytest.raises(RigError, match="no hit of the recorded campaigns"):
        list(running.measure_latency(bench))


TELLER = """\
import json, sys
for moment, released in ((1.0, True), (2.5, False), (4.0, True)):
    print(json.dumps({"time": moment, "released": released}), flush=True)
sys.stdin.read()
"""


@pytest.fixture
def teller() -> Iterator[Said]:
    with subprocess.Popen(
        [sys.executable, "-c", TELLER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        yield Said(process, lambda: "the holder is lost")
        process.kill()


def test_what_a_process_tells_is_waited_for(teller: Said) -> None:
    assert teller.wait_for("no stop", lambda said: not said["released"])["time"] == 2.5
    assert teller.wait_for("no swing")["time"] == 4.0


@pytest.mark.parametrize("is_over", [False, True])
def test_a_process_that_tells_nothing_more_is_named_by_the_log(
    teller: Said, *, is_over: bool
) -> None:
    for _ in range(3):
        teller.wait_for("no word")
    if is_over:
        teller.process.stdin.close()
    with pytest.raises(RigError, match="no stop: the holder is lost"):
        teller.wait_for("no stop", patience=60.0 if is_over else 0.01)
