"""The visualizer: model against measured traces, verdicts, tables and the rig's health, in Rerun.

A process of its own that only listens: it may drop views, never data, and nothing waits for it.
The file is written as hits come. What it keeps is bounded: the newest 1000 verdicts for the
tables, the names of what is shown, and 512 MB for viewers of this host that come late.
"""

import os
import time
from collections import deque
from collections.abc import Callable, Hashable
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from impact_rig_msgs.msg import (
    AccelerationBlock,
    HammerEstimate,
    Impact,
    ModelComparison,
    RigSetup,
    SampleEstimate,
    VirtualImpact,
)

from impact_rig.core.errors import RigError
from impact_rig.nodes import interfaces
from impact_rig.nodes.identity import id_from_msg
from impact_rig.nodes.process import run_node
from impact_rig.nodes.rig_node import DIAGNOSTIC_PERIOD, RateMeter, RigNode
from impact_rig.nodes.visualizer_campaign import ShownCampaign
from impact_rig.present.rerun.health import Health, Level, NodeHealth
from impact_rig.present.rerun.live_view import LiveView, ViewPlan
from impact_rig.present.rerun.view_log import ViewLog
from impact_rig.recordings.messages import (
    NO_ID,
    block_from_msg,
    label_from_msg,
    setup_from_msg,
    stamp_from_msg,
)
from impact_rig.recordings.new_file import choose_free
from impact_rig.results.hit_traces import TraceAssembler
from impact_rig.results.sample_traces import AlignedHit

SILENCE = 5.0 * DIAGNOSTIC_PERIOD
"""After what time without a word a node counts as silent [s], our choice."""


class RigHealth:
    """Keeps the last word of every node of one rig.

    Parameters
    ----------
    namespace : str
        Of the rig: the nodes right in it belong to it.
    """

    def __init__(self, namespace: str) -> None:
        self._prefix = namespace.rstrip("/") + "/"
        self._nodes: dict[str, tuple[NodeHealth, float]] = {}
        self._stamp = 0

    def add(self, message: DiagnosticArray) -> bool:
        """Keep what nodes of the rig say; return whether there was any."""
        own = [status for status in message.status if self._is_own(status.name)]
        for status in own:
            name = status.name.removeprefix(self._prefix)
            self._nodes[name] = (_convert(name, status), time.monotonic())
        if own:
            self._stamp = stamp_from_msg(message.header.stamp)
        return bool(own)

    def make_health(self) -> Health:
        """Return what is known now, by the names of the nodes."""
        now = time.monotonic()
        return Health(
            nodes=tuple(
                _mark_silent(node, now - heard) for _, (node, heard) in sorted(self._nodes.items())
            ),
            stamp=self._stamp,
        )

    def _is_own(self, name: str) -> bool:
        return name.startswith(self._prefix) and "/" not in name.removeprefix(self._prefix)


def _convert(name: str, status: DiagnosticStatus) -> NodeHealth:
    # rclpy gives a byte for a byte.
    level = status.level[0] if isinstance(status.level, bytes) else status.level
    values = tuple((item.key, item.value) for item in status.values)
    return NodeHealth(name, int(level), status.message, values)


def _mark_silent(node: NodeHealth, silence: float) -> NodeHealth:
    if silence < SILENCE:
        return node
    return NodeHealth(
        node.name, Level.STALE, f"silent for {silence:.0f} s; last: {node.message}", node.values
    )


NICENESS = 10
"""How far the process steps back [steps of nice], our choice."""
REFRESH_PERIOD = 1.0
"""Least time between two versions of what is replaced as a whole [s], our choice."""
Work = Callable[[ViewLog], None]
WAITING_MESSAGES = 1000
"""Messages kept while their set-up has not arrived [-], our choice: more than the topics keep."""


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
        self._latest: dict[Hashable, Work] = {}
        self._refreshing: Any = None
        self._is_behind = False
        self._left_out = 0
        self._last_reason = ""
        self._subscriptions_of_view: list[Any] = []
        self._assembler = TraceAssembler()
        self._campaign: ShownCampaign | None = None
        self._early: deque[tuple[Callable[[ShownCampaign, Any], None], Any]] = deque(
            maxlen=WAITING_MESSAGES
        )
        self._health = RigHealth(self.get_namespace())
        self._blocks_before = 0
        self._next_health = 0.0
        self._rates = {name: RateMeter() for name in ("blocks", "hits")}
        self._counts = {"campaigns": 0, "blocks": 0, "hits": 0, "comparisons": 0}

    def configure(self) -> None:
        """Open the file and the viewers."""
        output = self.get_value("output")
        plan = ViewPlan(
            output=str(choose_free(Path(output))) if output else "",
            **{name: self.get_value(name) for name in ("connect", "spawn", "web")},
        )
        log = self.get_logger()
        self._view = LiveView(plan, announce=log.info, notify=log.warning)
        self._refreshing = self.create_timer(REFRESH_PERIOD, self._refresh)
        self._campaign = None

    def activate(self) -> None:
        """Listen; what was said last before is heard now."""
        self._subscriptions_of_view = [
            self.listen(topic, callback)
            for topic, callback in (
                (interfaces.SETUP, self._begin),
                (interfaces.ACCELERATION, self._take_block),
                (interfaces.VIRTUAL_IMPACT, self._in_campaign(self._take_truth)),
                (interfaces.IMPACT, self._in_campaign(self._take_impact)),
                (interfaces.ESTIMATE, self._in_campaign(self._take_estimate)),
                (interfaces.HAMMER_ESTIMATE, self._in_campaign(self._take_hammer)),
                (interfaces.COMPARISON, self._in_campaign(self._take_comparison)),
                (interfaces.DIAGNOSTICS, self._take_diagnostics),
            )
        ]

    def deactivate(self) -> None:
        """Listen no longer."""
        for subscription in self._subscriptions_of_view:
            self.destroy_subscription(subscription)
        self._subscriptions_of_view = []

    def cleanup(self) -> None:
        """Write what is still to be written, and close."""
        if self._view is not None:
            self.destroy_timer(self._refreshing)
            self._log_latest()
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
            "views dropped": self._left_out,
        }

    def describe_warning(self) -> str:
        """Return why the view is not complete."""
        if self._is_behind:
            return "a viewer takes no data, or the disk is full: the view may be behind"
        return self._campaign.overlay.fault if self._campaign else ""

    def _put(self, work: Work) -> None:
        if self._view is None:
            return
        try:
            work(self._view.log)
        except RigError as error:
            self._left_out += 1
            if str(error) != self._last_reason:
                self._last_reason = str(error)
                self.get_logger().warning(f"a view is left out: {error}")

    def _put_latest(self, key: Hashable, work: Work) -> None:
        """Log something at the next refresh, in place of what the key had."""
        self._latest[key] = work

    def _log_latest(self) -> None:
        latest = tuple(self._latest.values())
        self._latest.clear()
        for work in latest:
            self._put(work)

    def _refresh(self) -> None:
        self._log_latest()
        if self._view is not None:
            self._is_behind = not self._view.flush()

    def _begin(self, message: RigSetup) -> None:
        setup = setup_from_msg(message)
        stamp = stamp_from_msg(message.header.stamp)
        campaign_id = id_from_msg(message.campaign_id)
        # As for the estimator: each set-up with a stamp begins a campaign, or goes on with it.
        shown = self._campaign
        if shown is not None and (not stamp or campaign_id == shown.campaign_id != NO_ID):
            return
        self._counts["campaigns"] += 1
        self._log_latest()
        campaign = self._campaign = ShownCampaign(setup, campaign_id)
        contact_times = [sample.reference_contact_time for sample in setup.samples.samples]
        self._put(
            lambda log: log.log_setup(
                setup.name, setup.samples.names, contact_times, setup.hammer_reading
            )
        )
        self._put_results(campaign)
        early = tuple(self._early)
        self._early.clear()
        for take, waiting in early:
            self._take_in_campaign(take, waiting)

    def _in_campaign(self, take: Callable[[ShownCampaign, Any], None]) -> Callable[[Any], None]:
        """Return a callback that takes what belongs to the campaign."""
        return lambda message: self._take_in_campaign(take, message)

    def _take_in_campaign(self, take: Callable[[ShownCampaign, Any], None], message: Any) -> None:
        """Take what belongs to the campaign, and keep what comes before its set-up, as it may.

        What was found in an earlier campaign, and is kept by its topic for who comes late, is not
        shown.
        """
        campaign = self._campaign
        if campaign is None or id_from_msg(message.campaign_id) != campaign.campaign_id:
            self._early.append((take, message))
        else:
            take(campaign, message)

    def _take_block(self, message: AccelerationBlock) -> None:
        self._counts["blocks"] += 1
        block = block_from_msg(message)
        traces = self._assembler.feed(block)
        if traces is not None:
            self._counts["hits"] += 1
            self._put(lambda log: log.log_hit(traces))
        if self._campaign is not None:
            for hit in self._campaign.overlay.feed(block):
                self._put_aligned(hit)

    def _put_aligned(self, hit: AlignedHit) -> None:
        self._put(lambda log: log.log_aligned_hit(hit))

    def _take_truth(self, campaign: ShownCampaign, message: VirtualImpact) -> None:
        campaign.add_truth(message)

    def _take_impact(self, campaign: ShownCampaign, message: Impact) -> None:
        verdict = campaign.add_hit(message)
        stamp = stamp_from_msg(message.header.stamp)
        self._put(lambda log: log.log_verdict(verdict, stamp))
        if verdict.accepted:
            hit = campaign.overlay.accept(label_from_msg(message))
            if hit is not None:
                self._put_aligned(hit)
        self._put_results(campaign)

    def _take_estimate(self, campaign: ShownCampaign, message: SampleEstimate) -> None:
        campaign.add_estimate(message)
        self._put_results(campaign)

    def _take_hammer(self, campaign: ShownCampaign, message: HammerEstimate) -> None:
        campaign.add_hammer(message)
        self._put_results(campaign)

    def _take_comparison(self, campaign: ShownCampaign, message: ModelComparison) -> None:
        self._counts["comparisons"] += 1
        campaign.add_comparison(message)
        sample = message.sample

        def show(log: ViewLog) -> None:
            traces = campaign.make_traces(sample)
            log.log_sample(traces)
            log.log_law(traces, campaign.make_law(sample), campaign.setup)

        self._put_latest(("traces", sample), show)

    def _take_diagnostics(self, message: DiagnosticArray) -> None:
        if not self._health.add(message):
            return
        health = self._health.make_health()
        blocks, now = self._counts["blocks"], time.monotonic()
        if blocks != self._blocks_before and now >= self._next_health:
            # While hits come their history is kept, second by second.
            self._blocks_before, self._next_health = blocks, now + DIAGNOSTIC_PERIOD
            self._put(lambda log: log.log_health(health))
        else:
            self._put_latest("health", lambda log: log.log_health(health))

    def _put_results(self, campaign: ShownCampaign) -> None:
        self._put_latest("results", lambda log: log.log_results(campaign.make_results()))


def main() -> int:
    """Run the node, behind all others: it may be late, the rig may not."""
    os.nice(NICENESS)
    return run_node(VisualizerNode)
