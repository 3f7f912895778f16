"""A stranger beside a campaign: publishes and asks at random on all topics and services."""

import time
from collections.abc import Iterator
from pathlib import Path

import mcap.reader

from bench.measure import Bench, Figure
from bench.rig_processes import RigProcesses
from bench.stranger import TOPICS, Stranger
from impact_rig.nodes.client import RigClient
from impact_rig.recordings.records import HEALTH_RECORD
from impact_rig.recordings.scan import Scan

PERIOD = 0.002
"""Time between two messages [s]."""
CAMPAIGN = ("--sample", "steel small", "--impacts", "100000")


class StrangerClient(RigClient):
    """A stranger in a rig's domain.

    Parameters
    ----------
    seed : int
        Of its messages.
    """

    def __init__(self, seed: int) -> None:
        super().__init__("stranger")
        self.stranger = Stranger(self._node, seed, TOPICS)

    def wait_for_campaign(self) -> bool:
        """Wait until a campaign's id is on the wire; return whether it is."""
        return self.spin_until(lambda: any(self.stranger.identity.campaign_id), 60.0)

    def trouble(self, seconds: float, *, with_ids: bool) -> None:
        """Publish and ask for so many seconds."""
        self.stranger.begin()
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            self.stranger.publish(with_ids=with_ids)
            if not with_ids:
                self.stranger.ask()
            self.spin_until(lambda: False, PERIOD)


def measure_foreign(bench: Bench) -> Iterator[Figure]:
    """Trouble a rig half of the time with other ids, and half with those of its campaign."""
    seconds = bench.extent.seconds
    for with_ids, name in ((False, "other ids"), (True, "its ids")):
        folder = bench.folder / name
        folder.mkdir()
        with RigProcesses(folder / "log.txt") as processes:
            nodes = processes.start_rig(folder, {"hammer": {"swing_time": 0.05}})
            nodes["visualizer"] = processes.start_node(
                "visualizer", output=str(folder / "session.rrd")
            )
            processes.start_command("campaign", *CAMPAIGN)
            with StrangerClient(bench.extent.seed) as client:
                client.wait_for_campaign()
                client.trouble(seconds, with_ids=with_ids)
                stranger = client.stranger
            ended = [name for name, process in nodes.items() if process.poll() is not None]
            processes.stop("recorder")
        note = f"{stranger.messages} messages, {stranger.requests} requests"
        yield Figure(f"nodes that a stranger with {name} ended", len(ended), note=note, most=0)
        if not with_ids:
            recording = folder / "session.mcap"
            recorded = stranger.list_recorded(Scan(recording).read_messages())
            yield Figure("its messages in the recording", len(recorded), most=0)
            yield Figure("losses that the recording counts", read_losses(recording), most=0)


def read_losses(path: Path) -> int:
    """Return how many messages did not get through, as the recorder has counted."""
    with path.open("rb") as file:
        records = mcap.reader.make_reader(file).iter_metadata()
        return next(
            int(it.metadata["messages_lost"]) for it in records if it.name == HEALTH_RECORD
        )
