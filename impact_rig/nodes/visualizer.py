"""The visualizer: model against measured traces, verdicts and tables, in Rerun.

A process of its own that only listens: it may drop views, never data, and nothing waits for it.
"""

import os
from typing import Any

import numpy as np
from impact_rig_msgs.msg import (
    AccelerationBlock,
    HammerEstimate,
    Impact,
    ModelComparison,
    RigSetup,
    SampleEstimate,
)

from impact_rig.core.setup.samples import SampleSet
from impact_rig.nodes import interfaces
from impact_rig.nodes.process import run_node
from impact_rig.nodes.rig_node import RigNode
from impact_rig.recording.interfaces.messages import (
    block_from_msg,
    label_from_msg,
    setup_from_msg,
    stamp_from_msg,
)
from impact_rig.results.hit_traces import TraceAssembler
from impact_rig.results.references import (
    explain_misprint,
    find_hammer_reference,
    find_reference,
)
from impact_rig.visualization.destinations import open_destinations
from impact_rig.visualization.log import ComparisonTraces
from impact_rig.visualization.sink import Destination, Work
from impact_rig.visualization.text import EstimateRow, EstimateTable, Quantity, Verdict

NICENESS = 10
"""How far the process steps back [steps of nice], our choice."""
TABLE = "table"
"""Key under which a table not yet shown is replaced by the next one."""


class VisualizerNode(RigNode):
    """Shows what the rig's topics say."""

    def __init__(self, **options: Any) -> None:
        super().__init__("visualizer", **options)
        self.declare("output", "", "path of the .rrd file to be written; empty: none")
        self.declare(
            "connect",
            "",
            "address of a running viewer, rerun+http://HOST:9876/proxy; empty: none",
        )
        self.declare("spawn", False, "open a viewer on this host")
        self._destinations: tuple[Destination, ...] = ()
        self._subscriptions_of_view: list[Any] = []
        self._assembler = TraceAssembler()
        self._samples: SampleSet | None = None
        self._estimates: dict[str, SampleEstimate] = {}
        self._hammer = HammerEstimate(stiffness=np.nan, damping_coefficient=np.nan)
        self._counts = {"hits": 0, "comparisons": 0}

    def configure(self) -> None:
        """Open the file and the viewers."""
        self._destinations = open_destinations(
            output=self.get_value("output"),
            connect=self.get_value("connect"),
            spawn=self.get_value("spawn"),
            notify=self.get_logger().warning,
        )
        self._samples = None
        self._estimates.clear()

    def activate(self) -> None:
        """Listen; what was said last before is heard now."""
        self._subscriptions_of_view = [
            self.listen(topic, callback)
            for topic, callback in (
                (interfaces.SETUP, self._begin),
                (interfaces.ACCELERATION, self._take_block),
                (interfaces.IMPACT, self._take_impact),
                (interfaces.ESTIMATE, self._take_estimate),
                (interfaces.HAMMER_ESTIMATE, self._take_hammer),
                (interfaces.COMPARISON, self._take_comparison),
            )
        ]

    def deactivate(self) -> None:
        """Listen no longer."""
        for subscription in self._subscriptions_of_view:
            self.destroy_subscription(subscription)
        self._subscriptions_of_view = []

    def cleanup(self) -> None:
        """Write what is still to be written, and close."""
        for destination in self._destinations:
            destination.close()
        self._destinations = ()

    def diagnose(self) -> dict[str, Any]:
        """Return what was shown, and what was not."""
        return {
            **self._counts,
            "views dropped": sum(item.dropped for item in self._destinations),
            "destinations lost": sum(item.is_lost for item in self._destinations),
        }

    def _put(self, work: Work) -> None:
        for destination in self._destinations:
            destination.put(work)

    def _put_latest(self, key: tuple[str, ...], work: Work) -> None:
        for destination in self._destinations:
            destination.put_latest(key, work)

    def _begin(self, message: RigSetup) -> None:
        setup = setup_from_msg(message)
        # A layout sent again would undo what the user has arranged.
        if self._samples is None or setup.samples.names != self._samples.names:
            self._estimates.clear()
            self._put(lambda log: log.log_setup(setup.name, setup.samples.names))
        self._samples = setup.samples
        self._put_table()

    def _take_block(self, message: AccelerationBlock) -> None:
        traces = self._assembler.feed(block_from_msg(message))
        if traces is not None:
            self._counts["hits"] += 1
            self._put(lambda log: log.log_hit(traces))

    def _take_impact(self, message: Impact) -> None:
        verdict = Verdict(
            label=label_from_msg(message),
            accepted=message.accepted,
            reasons=tuple(message.reasons),
            contact_time=message.contact_time,
            hammer_peak=message.hammer_peak,
            specimen_peak=message.specimen_peak,
        )
        stamp = stamp_from_msg(message.header.stamp)
        self._put(lambda log: log.log_verdict(verdict, stamp))

    def _take_estimate(self, message: SampleEstimate) -> None:
        self._estimates[message.sample] = message
        self._put_table()

    def _take_hammer(self, message: HammerEstimate) -> None:
        self._hammer = message
        self._put_table()

    def _take_comparison(self, message: ModelComparison) -> None:
        self._counts["comparisons"] += 1
        key = (message.model, message.sample)
        self._put_latest(key, lambda log: log.log_comparison(comparison_from_msg(message)))

    def _put_table(self) -> None:
        samples = self._samples
        if samples is None or not self._estimates:
            return
        table = make_table(samples, tuple(self._estimates.values()), self._hammer)
        self._put_latest((TABLE,), lambda log: log.log_estimates(table))


def comparison_from_msg(message: ModelComparison) -> ComparisonTraces:
    """Return a `ModelComparison` message as what the view shows of it."""
    traces = [
        np.frombuffer(memoryview(values), dtype=np.float32)
        for values in (
            message.hammer_measured,
            message.hammer_model,
            message.specimen_measured,
            message.specimen_model,
        )
    ]
    count = min(trace.size for trace in traces)
    return ComparisonTraces(
        sample=message.sample,
        model=message.model,
        time=message.start_time + np.arange(count) / message.sampling_rate,
        hammer_measured=traces[0][:count],
        hammer_model=traces[1][:count],
        specimen_measured=traces[2][:count],
        specimen_model=traces[3][:count],
        contact_time=message.contact_time,
        mse_hammer_percent=message.mse_hammer_percent,
        mse_sample_percent=message.mse_sample_percent,
    )


def make_table(
    samples: SampleSet, estimates: tuple[SampleEstimate, ...], hammer: HammerEstimate
) -> EstimateTable:
    """Set estimates beside what is expected of their samples, in the order of the set.

    Parameters
    ----------
    samples : SampleSet
        Estimates of samples that are not in it are left out.
    estimates : tuple of impact_rig_msgs.msg.SampleEstimate
        At most one per sample.
    hammer : impact_rig_msgs.msg.HammerEstimate
        Of the control experiment.
    """
    by_name = {estimate.sample: estimate for estimate in estimates}
    rows, footnotes = [], []
    names = [name for name in samples.names if name in by_name]
    references = [find_reference(samples, name) for name in names]
    for name, reference in zip(names, references, strict=True):
        estimate = by_name[name]
        if reference.is_misprinted and reference.published is not None:
            footnotes.append(explain_misprint(reference.published))
        rows.append(
            EstimateRow(
                name=name,
                impacts_accepted=estimate.impacts_accepted,
                impacts_rejected=estimate.impacts_rejected,
                contact_time=Quantity(estimate.contact_time, reference.contact_time),
                stiffness=Quantity(estimate.stiffness, reference.stiffness),
                damping_coefficient=Quantity(
                    estimate.damping_coefficient, reference.damping_coefficient
                ),
                mse_hammer_percent=estimate.mse_hammer_percent,
                mse_sample_percent=estimate.mse_sample_percent,
                mark="*" if reference.is_misprinted else "",
            )
        )
    expected = find_hammer_reference(samples)
    return EstimateTable(
        rows=tuple(rows),
        hammer_stiffness=Quantity(hammer.stiffness, expected.stiffness),
        hammer_damping_coefficient=Quantity(
            hammer.damping_coefficient, expected.damping_coefficient
        ),
        reference_name="paper" if all(it.is_published for it in references) else "expected",
        footnotes=tuple(footnotes),
    )


def main() -> int:
    """Run the node, behind all others: it may be late, the rig may not."""
    os.nice(NICENESS)
    return run_node(VisualizerNode)


if __name__ == "__main__":
    raise SystemExit(main())
