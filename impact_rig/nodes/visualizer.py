"""The visualizer: model against measured traces, verdicts, tables and the rig's health, in Rerun.

A separate process that only listens: it may drop views, never data, and nothing waits for it.
The file is written as hits come. What it keeps of a hit is its verdict; 512 MB wait for viewers of
this host that come late.
"""

import os
import time
from collections import deque
from collections.abc import Callable, Hashable
from copy import copy
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from impact_rig_msgs.msg import (
    AccelerationBlock,
    Impact,
    ModelComparison,
    RigSetup,
)

from impact_rig.core.errors import RigError
from impact_rig.nodes import interfaces
from impact_rig.nodes.identity import id_from_msg
from impact_rig.nodes.process import run_node
from impact_rig.nodes.rig_node import DIAGNOSTIC_PERIOD, RateMeter, RigNode
from impact_rig.nodes.visualizer_campaign import Finding, ShownCampaign
from impact_rig.present.rerun.delivery import LiveView
from impact_rig.present.rerun.health import Level, NodeHealth
from impact_rig.present.rerun.view_log import ViewLog
from impact_rig.recordings.messages import (
    NO_ID,
    block_from_msg,
    label_from_msg,
    setup_from_msg,
    stamp_from_msg,
)
from impact_rig.recordings.new_file import choose_free
from impact_rig.results.traces import TraceAssembler

SILENCE = 5.0 * DIAGNOSTIC_PERIOD
"""How long a node that is not silent may take between two diagnostics [s], our choice."""


class RigHealth:
    """Keeps the newest diagnostics of each node in the namespace of a rig."""

    def __init__(self, namespace: str) -> None:
        self._prefix = namespace.rstrip("/") + "/"
        self._nodes: dict[str, tuple[NodeHealth, float]] = {}

    def add(self, message: DiagnosticArray) -> bool:
        """Keep the diagnostics of the rig's nodes; return whether there are any."""
        is_any = False
        for status in message.status:
            name = status.name.removeprefix(self._prefix)
            if name != status.name and "/" not in name:
                # rclpy has a byte as bytes.
                level = Level(int.from_bytes(status.level))
                values = tuple((item.key, item.value) for item in status.values)
                health = NodeHealth(name, level, status.message, values)
                self._nodes[name], is_any = (health, time.monotonic()), True
        return is_any

    def list_nodes(self) -> tuple[NodeHealth, ...]:
        """Return the newest diagnostics, by the names of the nodes."""
        nodes = []
        for _, (node, came) in sorted(self._nodes.items()):
            silence = time.monotonic() - came
            message = f"silent for {silence:.0f} s; last: {node.message}"
            is_silent = silence >= SILENCE
            nodes.append(replace(node, level=Level.STALE, message=message) if is_silent else node)
        return tuple(nodes)


NICENESS = 10
"""How far the process steps back [steps of nice], our choice."""
REFRESH_PERIOD = 1.0
"""Least time between two versions of what is replaced as a whole [s], our choice."""
Work = Callable[[ViewLog], None]
WAITING_BLOCKS = 2000
"""Blocks that may wait before the oldest are lost [-], our choice: 16 MB, for the seconds that the
first plots take on a busy computer."""
WAITING_MESSAGES = 1000
"""Messages kept while their set-up has not arrived [-], our choice: more than the topics keep."""


def _deepen(topic: interfaces.Topic) -> interfaces.Topic:
    """Return a topic of which `WAITING_BLOCKS` may wait."""
    qos = copy(topic.qos)
    qos.depth = WAITING_BLOCKS
    return replace(topic, qos=qos)


class VisualizerNode(RigNode):
    """Shows what the rig's topics say."""

    def __init__(self, **options: Any) -> None:
        super().__init__("visualizer", **options)
        self.offer_to_join()
        self.declare("output", "", "path of the .rrd file to be written; empty: none")
        self.declare(
            "connect",
            "",
            "address of a viewer elsewhere that is there already, rerun+http://HOST:9876/proxy;"
            " empty: none",
        )
        self.declare("spawn", False, "open a viewer on this host")
        self.declare("web", False, "serve a web page for this host; the log says where")
        self._view: LiveView | None = None
        self._latest: dict[Hashable, Work] = {}  # to be logged at the next refresh
        self._refreshing: Any = None
        self._is_behind = False
        self._last_reason = ""
        self._subscriptions_of_view: list[Any] = []
        self._assembler = TraceAssembler()
        self._campaign: ShownCampaign | None = None
        self._early: deque[Finding] = deque(maxlen=WAITING_MESSAGES)
        self._health = RigHealth(self.get_namespace())
        self._rates = {name: RateMeter() for name in ("blocks", "hits")}
        self._counts = {"blocks": 0, "hits": 0, "comparisons": 0}

    def configure(self) -> None:
        """Open the file and the viewers."""
        output = self.get_value("output")
        log = self.get_logger()
        self._view = LiveView(
            output=str(choose_free(Path(output))) if output else "",
            **{name: self.get_value(name) for name in ("connect", "spawn", "web")},
            announce=log.info,
            notify=log.warning,
        )
        self._refreshing = self.create_timer(REFRESH_PERIOD, self._refresh)
        self._campaign = None

    def activate(self) -> None:
        """Subscribe; latched messages come at once."""
        self._subscriptions_of_view = [
            self.listen(topic, callback)
            for topic, callback in (
                (interfaces.SETUP, self._on_setup),
                (_deepen(interfaces.ACCELERATION), self._on_block),
                (interfaces.VIRTUAL_IMPACT, self._on_finding),
                (interfaces.IMPACT, self._on_finding),
                (interfaces.ESTIMATE, self._on_finding),
                (interfaces.HAMMER_ESTIMATE, self._on_finding),
                (interfaces.COMPARISON, self._on_finding),
                (interfaces.DIAGNOSTICS, self._on_diagnostics),
            )
        ]

    def deactivate(self) -> None:
        """Withdraw the subscriptions."""
        for subscription in self._subscriptions_of_view:
            self.destroy_subscription(subscription)
        self._subscriptions_of_view = []

    def cleanup(self) -> None:
        """Write what is still to be written, and close."""
        if self._view is not None:
            self.destroy_timer(self._refreshing)
            self._log_latest()
            if warning := self.describe_warning():
                self.get_logger().warning(warning)
            self._view.close()
            self._view = None

    def diagnose(self) -> dict[str, Any]:
        """Return what was shown, how fast it came, and what was not shown."""
        return {
            **self._counts,
            **{
                f"{name} per second": f"{meter.measure(self._counts[name]):.1f}"
                for name, meter in self._rates.items()
            },
            "hits missing": self._campaign.missing if self._campaign else 0,
        }

    def describe_warning(self) -> str | None:
        """Return why the view is not complete."""
        if self._is_behind:
            return "a viewer takes no data, or the disk is full: the view may be behind"
        missing = self._campaign.missing if self._campaign else 0
        if not missing:
            return None
        return (
            f"{missing} hits are missing: the view was too slow for them;"
            " impact-rig view shows all of the recording"
        )

    def _log(self, work: Work) -> None:
        if self._view is None:
            return
        try:
            work(self._view.log)
        except RigError as error:
            if str(error) != self._last_reason:
                self._last_reason = str(error)
                self.get_logger().warning(f"a view is left out: {error}")

    def _log_latest(self) -> None:
        latest = tuple(self._latest.values())
        self._latest.clear()
        for work in latest:
            self._log(work)

    def _refresh(self) -> None:
        self._log_latest()
        if self._view is not None:
            self._is_behind = not self._view.flush()

    def _on_setup(self, message: RigSetup) -> None:
        setup = setup_from_msg(message)
        stamp = stamp_from_msg(message.header.stamp)
        campaign_id = id_from_msg(message.campaign_id)
        # As for the estimator: each set-up with a stamp begins a campaign, or goes on with it.
        shown = self._campaign
        if shown is not None and (not stamp or campaign_id == shown.campaign_id != NO_ID):
            return
        self._log_latest()
        campaign = self._campaign = ShownCampaign(setup, campaign_id)
        contact_times = [sample.reference_contact_time for sample in setup.samples.samples]
        self._log(
            lambda log: log.log_setup(
                setup.name, setup.samples.names, contact_times, setup.hammer_reading
            )
        )
        self._log_results_soon(campaign)
        early = tuple(self._early)
        self._early.clear()
        for waiting in early:
            self._on_finding(waiting)

    def _on_finding(self, message: Finding) -> None:
        """Show what was found in the campaign; a message of another may be before its set-up."""
        campaign = self._campaign
        if campaign is None or id_from_msg(message.campaign_id) != campaign.campaign_id:
            self._early.append(message)
            return
        campaign.add(message)
        if isinstance(message, Impact):
            verdict, stamp = campaign.newest_hit, stamp_from_msg(message.header.stamp)
            self._log(lambda log: log.log_verdicts([verdict], [stamp]))
            if hit := campaign.align_judged(label_from_msg(message)):
                self._log(lambda log: log.log_aligned_hits([hit]))
        if isinstance(message, ModelComparison):
            self._counts["comparisons"] += 1
            self._latest["traces", message.sample] = partial(
                _log_sample, campaign=campaign, sample=message.sample
            )
        self._log_results_soon(campaign)

    def _on_block(self, message: AccelerationBlock) -> None:
        self._counts["blocks"] += 1
        block = block_from_msg(message)
        traces = self._assembler.feed(block)
        if traces is not None:
            self._counts["hits"] += 1
            self._log(lambda log: log.log_hit(traces))
        if self._campaign is not None:
            if traces is not None:
                self._campaign.note_shown(block.label)
            if hits := self._campaign.align(block):
                self._log(lambda log: log.log_aligned_hits(hits))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        if self._health.add(message):
            nodes, stamp = self._health.list_nodes(), stamp_from_msg(message.header.stamp)
            self._latest["health"] = lambda log: log.log_health(nodes, stamp)

    def _log_results_soon(self, campaign: ShownCampaign) -> None:
        self._latest["results"] = lambda log: log.log_results(campaign.make_results())


def _log_sample(log: ViewLog, campaign: ShownCampaign, sample: str) -> None:
    log.log_sample(campaign.make_traces(sample), campaign.make_law(sample), campaign.setup)


def main() -> int:
    """Run the node, behind all others: it may be late, the rig may not."""
    os.nice(NICENESS)
    return run_node(VisualizerNode)
