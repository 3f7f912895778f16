"""The visualizer: model against measured traces, verdicts and tables, in Rerun.

A separate process that only listens: it may drop views, never data, and nothing waits for it.
The file is written as hits come. What it keeps of a hit is its verdict; 512 MB wait for viewers of
this host that come late.
"""

import shutil
from collections import Counter
from collections.abc import Callable, Hashable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from impact_rig.configuration.processes import Notice, notify
from impact_rig.core.estimates.contact_law import NO_LAW
from impact_rig.core.estimates.paper_method import HammerEstimate
from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.given.errors import RigError
from impact_rig.core.given.records import Block, HitLabel
from impact_rig.core.given.setup import RigSetup
from impact_rig.nodes import interfaces
from impact_rig.nodes.campaign_feed import CampaignFeed
from impact_rig.nodes.intake import Received
from impact_rig.nodes.interfaces import Topic
from impact_rig.nodes.rig_node import RigNode
from impact_rig.present.rerun.delivery import LiveView
from impact_rig.present.rerun.view_log import ViewLog
from impact_rig.recordings.messages import RecordedTruth
from impact_rig.recordings.new_file import ROOM_FOR_ENDING, choose_free
from impact_rig.results.campaign import HitResults, Results
from impact_rig.results.traces import JudgedTraces, SampleTraces, TraceAssembler

Finding: TypeAlias = (
    RecordedTruth | HitResults | JudgedTraces | SampleEstimate | HammerEstimate | SampleTraces
)
LARGEST_CAMPAIGN = 1000
"""Most hits that tables show, the newest [-]: eight of the paper's campaigns."""


class ShownCampaign:
    """Keeps the newest finding of each hit, sample and model of a campaign."""

    def __init__(self, setup: RigSetup, largest: int = LARGEST_CAMPAIGN) -> None:
        self.setup = setup
        self._largest = largest
        self._numbers: Counter[str] = Counter()
        self._hits: dict[HitLabel, HitResults] = {}  # the newest, as many as are shown
        self._faults: dict[HitLabel, tuple[str, ...]] = {}
        self._hammer = HammerEstimate()
        self.estimates: dict[str, SampleEstimate] = {}
        self._traces: dict[str, dict[str, SampleTraces]] = {}  # each with one model

    def is_laid_over(self, traces: JudgedTraces) -> bool:
        """Return whether a hit is laid over the others: an accepted one, of many only some.

        From a sample's hundredth hit on it is every tenth, from the thousandth on every hundredth,
        and so on: more would be a black band.
        """
        if not traces.accepted:
            return False
        sample = traces.aligned.label.sample
        self._numbers[sample] = number = self._numbers[sample] + 1
        return number % 10 ** max(0, len(str(number)) - 2) == 0

    def add(self, found: Finding) -> None:
        """Keep a finding in place of the older one of its hit, sample or model."""
        match found:
            case RecordedTruth():
                self._faults[found.label] = found.truth.faults
            case HitResults():
                self._hits[found.label] = self.add_faults(found)
                for kept in (self._hits, self._faults):
                    if len(kept) > self._largest:
                        del kept[next(iter(kept))]
            case SampleEstimate():
                self.estimates[found.name] = found
            case HammerEstimate():
                self._hammer = found
            case SampleTraces():
                models = self._traces.setdefault(found.name, {})
                models.pop(found.models[0].model, None)
                models[found.models[0].model] = found

    def add_faults(self, hit: HitResults) -> HitResults:
        """Return a hit with the faults that were built into it."""
        return replace(hit, injected_faults=self._faults.get(hit.label, ()))

    def make_results(self) -> Results:
        """Return the results so far."""
        names = filter(self.estimates.__contains__, self.setup.samples.names)
        samples = tuple(self.estimates[name] for name in names)
        return Results(self.setup, self._hammer, samples, tuple(self._hits.values()))

    def make_traces(self, sample: str) -> SampleTraces:
        """Return the newest mean of one sample, with its models and widths."""
        known = tuple(self._traces[sample].values())
        newest, estimate = known[-1], self.estimates.get(sample)
        models = (one.models[0] for one in known if np.array_equal(one.mean, newest.mean))
        traces = replace(newest, models=tuple(models))
        if estimate is None:
            return traces
        return replace(
            traces,
            half_amplitude_width=estimate.paper.half_amplitude_width.value,
            first_peak_time=estimate.paper.first_peak_time,
            second_peak_time=estimate.paper.second_peak_time,
        )

    def log_sample(self, sample: str, log: ViewLog) -> None:
        """Show one sample, with its law if that is known."""
        estimate = self.estimates.get(sample)
        law = estimate.contact_law if estimate else NO_LAW
        log.log_sample(self.make_traces(sample), law, self.setup)


Work = Callable[[ViewLog], None]


class VisualizerNode(RigNode):
    """Shows the rig's topics in Rerun."""

    def __init__(self, **options: Any) -> None:
        super().__init__("visualizer", **options)
        self._is_to_join = True
        self._view: LiveView | None = None
        self._latest: dict[Hashable, Work] = {}  # to be logged at the next refresh
        self._refreshing: Any = None
        self._is_behind = False
        self._left_out = ""  # why the last view that could not be shown was not
        self._subscriptions_of_view: list[Any] = []
        self._assembler = TraceAssembler()
        self._feed = CampaignFeed(self._on_campaign, self._on_finding)
        self._campaign: ShownCampaign  # that of the feed
        self._counts = {"blocks": 0, "hits": 0, "comparisons": 0, "left out": 0}

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
        if self._view.page is not None:
            notify(Notice.PAGE, self._view.page)
        self._log(lambda log: log.log_setup("", ()))
        # What is replaced as a whole is replaced once a second.
        self._refreshing = self.create_timer(1.0, self._refresh)

    def autostart(self) -> None:
        """Subscribe before Rerun loads: what comes meanwhile waits."""
        if self.get_value("autostart"):
            self._subscribe()
        super().autostart()
        if not self.is_active:
            self.deactivate()

    def activate(self) -> None:
        """Subscribe; latched messages come at once."""
        if self._is_to_join:  # not before: a campaign's start waits for who takes part
            self._is_to_join = False
            self.offer_to_join()
        if not self._subscriptions_of_view:
            self._subscribe()
        self._leave_room()

    def _subscribe(self) -> None:
        self._subscriptions_of_view = [
            self.listen(topic, callback)
            for topic, callback in (
                (interfaces.SETUP, self._feed.on_setup),
                # 16 MB each, for the seconds that Rerun and its first plots take on a busy
                # computer.
                (interfaces.ACCELERATION.deepen(2000), self._on_block),
                (interfaces.IMPACT_TRACE.deepen(300), self._feed.on_finding),
                (interfaces.COMPARISON.deepen(200), self._feed.on_finding),
                (interfaces.VIRTUAL_IMPACT, self._feed.on_finding),
                (interfaces.IMPACT, self._feed.on_finding),
                (interfaces.ESTIMATE, self._feed.on_finding),
                (interfaces.HAMMER_ESTIMATE, self._feed.on_finding),
            )
        ]

    def deactivate(self) -> None:
        """Withdraw the subscriptions."""
        for subscription in self._subscriptions_of_view:
            self.destroy_subscription(subscription)
        self._subscriptions_of_view = []

    def cleanup(self) -> None:
        """Write the last views, and close."""
        if self._view is not None:
            self.destroy_timer(self._refreshing)
            self._log_latest()
            if warning := self.describe_warning():
                self.get_logger().warning(warning)
            self._view.close()
            self._view = None
            self._feed = CampaignFeed(self._on_campaign, self._on_finding)

    def diagnose(self) -> dict[str, Any]:
        """Return how many messages were shown, and how many left out."""
        return dict(self._counts)

    def describe_warning(self) -> str | None:
        """Return why the view is not complete."""
        late = "a viewer takes no data, or the disk is full: the view may be behind"
        reasons = [late] * self._is_behind
        if self._left_out:
            reasons.append(f"a view was left out: {self._left_out}")
        return "; ".join(reasons) or None

    def on_received(
        self, topic: Topic, callback: Callable[[Any], None], received: Received[Any]
    ) -> None:
        """Call back, and go on whatever happens: a rig does not end with its display."""
        self._try(f"{topic.name}: ", lambda: callback(received))

    def _try(self, what: str, work: Callable[[], None]) -> None:
        try:
            work()
        except Exception as error:  # noqa: BLE001 - whatever cannot be shown is left out
            text = str(error) if isinstance(error, RigError) else repr(error)
            self._counts["left out"] += 1
            if self._left_out != what + text:
                self._left_out = what + text
                self.get_logger().warning(f"a view is left out: {self._left_out}")

    def _log(self, work: Work) -> None:
        if (view := self._view) is not None:
            self._try("", lambda: work(view.log))

    def _log_latest(self) -> None:
        latest = tuple(self._latest.values())
        self._latest.clear()
        for work in latest:
            self._log(work)

    def _refresh(self) -> None:
        self._log_latest()
        if self._view is not None:
            self._is_behind = not self._view.flush()
        self._leave_room()

    def _leave_room(self) -> None:
        """End the view where the disk is nearly full: what room it has is the recorder's."""
        if not (output := self.get_value("output")) or not self._subscriptions_of_view:
            return
        if shutil.disk_usage(Path(output).parent).free < 2 * ROOM_FOR_ENDING:
            self._left_out = "the disk is nearly full, and what room it has is the recorder's"
            self.deactivate()

    def _on_campaign(self, received: Received[RigSetup]) -> None:
        self._log_latest()
        setup = received.value
        campaign = self._campaign = ShownCampaign(setup)
        contact_times = [sample.reference_contact_time for sample in setup.samples.samples]
        self._log(
            lambda log: log.log_setup(
                setup.name, setup.samples.names, contact_times, setup.hammer_reading
            )
        )
        self._log_results_soon(campaign)

    def _on_finding(self, received: Received[Finding]) -> None:
        """Show a finding of the campaign."""
        campaign, found = self._campaign, received.value
        if isinstance(found, JudgedTraces):
            if campaign.is_laid_over(found):
                self._log(lambda log: log.log_aligned_hits([found.aligned]))
            return
        campaign.add(found)
        if isinstance(found, HitResults):
            verdict = campaign.add_faults(found)
            self._log(lambda log: log.log_verdicts([verdict], [received.stamp]))
        if isinstance(found, SampleTraces):
            self._counts["comparisons"] += 1
            self._latest["traces", found.name] = partial(campaign.log_sample, found.name)
        self._log_results_soon(campaign)

    def _on_block(self, received: Received[Block]) -> None:
        self._counts["blocks"] += 1
        block = received.value
        traces = self._assembler.feed(block)
        if traces is not None:
            self._counts["hits"] += 1
            self._log(lambda log: log.log_hit(traces))

    def _log_results_soon(self, campaign: ShownCampaign) -> None:
        self._latest["results"] = lambda log: log.log_results(campaign.make_results())
