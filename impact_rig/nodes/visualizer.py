"""The visualizer: model against measured traces, verdicts, tables and the rig's health, in Rerun.

A separate process that only listens: it may drop views, never data, and nothing waits for it.
The file is written as hits come. What it keeps of a hit is its verdict; 512 MB wait for viewers of
this host that come late.
"""

import math
import time
from collections import Counter, deque
from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from impact_rig_msgs.msg import (
    AccelerationBlock,
    HammerEstimate,
    Impact,
    ModelComparison,
    SampleEstimate,
    VirtualImpact,
)
from impact_rig_msgs.msg import RigSetup as RigSetupMessage
from numpy.typing import NDArray

from impact_rig.core import paper_method, sample
from impact_rig.core.contact_law import NO_LAW, ContactLaw
from impact_rig.core.detection import ImpactDetector
from impact_rig.core.errors import RigError
from impact_rig.core.hits import judge_hit
from impact_rig.core.records import Block, HitLabel, Record
from impact_rig.core.setup import RigSetup
from impact_rig.nodes import interfaces
from impact_rig.nodes.identity import id_from_msg
from impact_rig.nodes.result_messages import hit_results_from_msg
from impact_rig.nodes.rig_node import DIAGNOSTIC_PERIOD, RigNode
from impact_rig.present.rerun.delivery import LiveView
from impact_rig.present.rerun.health import Level, NodeHealth
from impact_rig.present.rerun.view_log import ViewLog
from impact_rig.recordings.campaigns import begins_campaign
from impact_rig.recordings.messages import (
    block_from_msg,
    from_message,
    label_from_msg,
    setup_from_msg,
    stamp_from_msg,
)
from impact_rig.recordings.new_file import choose_free
from impact_rig.results.campaign import HitResults, Results
from impact_rig.results.traces import (
    AlignedHit,
    ModelTraces,
    SampleTraces,
    TraceAssembler,
    align_hit,
)

SILENCE = 5.0 * DIAGNOSTIC_PERIOD
"""How long a node that is not silent may take between two diagnostics [s]."""


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


def sample_traces_from_msgs(
    comparisons: Sequence[ModelComparison], estimate: SampleEstimate | None
) -> SampleTraces:
    """Return the mean hit of a sample in m/s^2, with the models that were laid onto it.

    Parameters
    ----------
    comparisons : sequence of impact_rig_msgs.msg.ModelComparison
        Of one sample, the newest of each model, the newest of all last; those of another mean
        than this one are left out.
    estimate : impact_rig_msgs.msg.SampleEstimate or None
        Of the same sample.

    Returns
    -------
    SampleTraces
    """
    newest = comparisons[-1]
    peaks = np.array([[newest.hammer_peak], [newest.specimen_peak]])
    mean = _stack(newest.hammer_measured, newest.specimen_measured) * peaks
    models = tuple(
        ModelTraces(
            model=comparison.model,
            traces=_stack(comparison.hammer_model, comparison.specimen_model) * peaks,
            mse_percent=(comparison.mse_hammer_percent, comparison.mse_sample_percent),
        )
        for comparison in comparisons
        if comparison.impacts_accepted == newest.impacts_accepted
        and len(comparison.hammer_model) == mean.shape[1]
    )
    return SampleTraces(
        name=newest.sample,
        sampling_rate=newest.sampling_rate,
        # There from the start of the contact, here from its middle.
        start_time=newest.start_time - newest.contact_time / 2.0,
        mean=mean,
        contact_time=newest.contact_time,
        half_amplitude_width=estimate.half_amplitude_width if estimate else math.nan,
        first_peak_time=estimate.first_peak_time if estimate else math.nan,
        second_peak_time=estimate.second_peak_time if estimate else math.nan,
        models=models,
    )


def _stack(hammer: Any, specimen: Any) -> NDArray[np.float64]:
    """Return two traces of a message, shape (2, n)."""
    traces = [np.frombuffer(memoryview(trace), np.float32) for trace in (hammer, specimen)]
    return np.stack(traces).astype(np.float64)


def is_shown(number: int) -> bool:
    """Whether the hit of this number, counted from 1 for each sample, is shown.

    From the hundredth hit on it is every tenth, from the thousandth on every hundredth, and so on:
    more would be a black band.
    """
    step = 1
    while number >= step * 100:
        step *= 10
    return number % step == 0


Finding: TypeAlias = VirtualImpact | Impact | SampleEstimate | HammerEstimate | ModelComparison
LARGEST_CAMPAIGN = 1000
"""Most hits that tables show, the newest [-]: eight of the paper's campaigns."""


class ShownCampaign:
    """Keeps the newest message about each hit, sample and model of a campaign."""

    def __init__(self, setup: RigSetup, campaign_id: bytes) -> None:
        self.setup = setup
        self.campaign_id = campaign_id
        self._detector = ImpactDetector(setup.analysis)
        self._records: deque[Record] = deque(maxlen=10)  # one waits for its verdict
        self._numbers: Counter[str] = Counter()
        self._hits: dict[HitLabel, HitResults] = {}
        self._faults: dict[HitLabel, tuple[str, ...]] = {}
        self._hammer: HammerEstimate | None = None
        self.estimates: dict[str, SampleEstimate] = {}
        self._comparisons: dict[str, dict[str, ModelComparison]] = {}

    def add_block(self, block: Block) -> None:
        """Keep the record that a block completes until its verdict comes."""
        self._records.extend(self._detector.feed(block))

    def align(self, label: HitLabel) -> AlignedHit | None:
        """Return an accepted hit, to be laid over the others; of a long series only some."""
        record = next((it for it in self._records if it.label == label), None)
        # A flaw is a block that was lost on the way to this node.
        if record is None or record.flaws or not self._hits[label].accepted:
            return None
        self._numbers[label.sample] += 1
        if not is_shown(self._numbers[label.sample]):
            return None
        hit = judge_hit(record, self.setup.analysis, self.setup.responses).filtered
        return None if hit is None else align_hit(label, hit)

    def add(self, message: Finding) -> None:
        """Keep what was found, in place of what was known of the same hit, sample and model."""
        match message:
            case VirtualImpact():
                self._faults[label_from_msg(message)] = tuple(message.faults)
            case Impact():
                label = label_from_msg(message)
                self._hits[label] = hit_results_from_msg(message, self._faults.get(label, ()))
            case SampleEstimate():
                self.estimates[message.name] = message
            case HammerEstimate():
                self._hammer = message
            case ModelComparison():
                models = self._comparisons.setdefault(message.sample, {})
                models.pop(message.model, None)
                models[message.model] = message

    @property
    def newest_hit(self) -> HitResults:
        """The hit that was kept last."""
        return next(reversed(self._hits.values()))

    def make_results(self) -> Results:
        """Return what is known now."""
        hammer, estimates = self._hammer, self.estimates
        return Results(
            setup=self.setup,
            hammer=paper_method.HammerEstimate()
            if hammer is None
            else from_message(paper_method.HammerEstimate, hammer),
            samples=tuple(
                from_message(sample.SampleEstimate, estimates[name])
                for name in self.setup.samples.names
                if name in estimates
            ),
            hits=tuple(self._hits.values())[-LARGEST_CAMPAIGN:],
        )

    def make_traces(self, sample: str) -> SampleTraces:
        """Return the traces of one sample as they are known now; errors as they are joined."""
        comparisons = tuple(self._comparisons[sample].values())
        estimate = self.estimates.get(sample)
        return sample_traces_from_msgs(comparisons, estimate)


Work = Callable[[ViewLog], None]


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
        # Of a campaign whose set-up has not come: more than the topics keep.
        self._early: deque[Finding] = deque(maxlen=1000)
        self._health = RigHealth(self.get_namespace())
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
        # What is replaced as a whole is replaced once a second.
        self._refreshing = self.create_timer(1.0, self._refresh)
        self._campaign = None

    def activate(self) -> None:
        """Subscribe; latched messages come at once."""
        self._subscriptions_of_view = [
            self.listen(topic, callback)
            for topic, callback in (
                (interfaces.SETUP, self._on_setup),
                # 16 MB, for the seconds that the first plots take on a busy computer.
                (interfaces.ACCELERATION.deepen(2000), self._on_block),
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
        """Return what was shown."""
        return dict(self._counts)

    def describe_warning(self) -> str | None:
        """Return why the view is not complete."""
        late = "a viewer takes no data, or the disk is full: the view may be behind"
        return late if self._is_behind else None

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

    def _on_setup(self, message: RigSetupMessage) -> None:
        shown = self._campaign
        if not begins_campaign(message, None if shown is None else shown.campaign_id):
            return
        self._log_latest()
        setup = setup_from_msg(message)
        campaign = self._campaign = ShownCampaign(setup, id_from_msg(message.campaign_id))
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
            if hit := campaign.align(label_from_msg(message)):
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
        if self._campaign is not None:
            self._campaign.add_block(block)
        traces = self._assembler.feed(block)
        if traces is not None:
            self._counts["hits"] += 1
            self._log(lambda log: log.log_hit(traces))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        if self._health.add(message):
            nodes, stamp = self._health.list_nodes(), stamp_from_msg(message.header.stamp)
            self._latest["health"] = lambda log: log.log_health(nodes, stamp)

    def _log_results_soon(self, campaign: ShownCampaign) -> None:
        self._latest["results"] = lambda log: log.log_results(campaign.make_results())


def _log_sample(log: ViewLog, campaign: ShownCampaign, sample: str) -> None:
    estimate = campaign.estimates.get(sample)
    law = from_message(ContactLaw, estimate.contact_law) if estimate else NO_LAW
    log.log_sample(campaign.make_traces(sample), law, campaign.setup)
