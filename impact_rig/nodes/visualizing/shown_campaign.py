"""The campaign that goes on now, as the topics tell it."""

import threading
from collections import OrderedDict
from typing import Any

from impact_rig_msgs.msg import (
    HammerEstimate,
    Impact,
    ModelComparison,
    SampleEstimate,
    VirtualImpact,
)

from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.signals.record import HitLabel
from impact_rig.nodes.messages import hit_results_from_msg
from impact_rig.nodes.result_messages import result_from_msg
from impact_rig.nodes.visualizing.comparisons import sample_traces_from_msgs
from impact_rig.nodes.visualizing.overlay import HitOverlay
from impact_rig.recording.interfaces.messages import label_from_msg
from impact_rig.results.campaign import HitResults, Results
from impact_rig.results.estimates import HammerResults, SampleResults
from impact_rig.results.sample_traces import SampleTraces
from impact_rig.results.setup_results import setup_results_from_setup

LARGEST_CAMPAIGN = 1000
"""Hits that tables and figures show at most, the newest [-], our choice: eight of the paper's
campaigns. Beyond, the node's memory does not grow."""


class ShownCampaign:
    """Keeps the newest word on everything.

    Added to by one thread; results and traces may be made by others.

    Parameters
    ----------
    setup : RigSetup
        With what is measured.
    stamp : int
        When that was said, by which all that is found under it names it [ns].
    """

    def __init__(self, setup: RigSetup, stamp: int) -> None:
        self.setup = setup
        self.stamp = stamp
        self.overlay = HitOverlay(setup.analysis)
        self._lock = threading.Lock()
        self._hits: OrderedDict[HitLabel, HitResults] = OrderedDict()
        self._faults: OrderedDict[HitLabel, tuple[str, ...]] = OrderedDict()
        self._hammer: HammerEstimate | None = None
        self._estimates: dict[str, SampleEstimate] = {}
        self._comparisons: dict[str, dict[str, ModelComparison]] = {}

    def add_truth(self, message: VirtualImpact) -> None:
        """Keep what the virtual rig did on purpose."""
        with self._lock:
            _keep(self._faults, label_from_msg(message), tuple(message.faults))

    def add_hit(self, message: Impact) -> HitResults:
        """Keep a verdict, and return it."""
        label = label_from_msg(message)
        with self._lock:
            hit = hit_results_from_msg(message, self._faults.get(label, ()))
            _keep(self._hits, label, hit)
        return hit

    def add_estimate(self, message: SampleEstimate) -> None:
        """Keep an estimate in place of the one before."""
        with self._lock:
            self._estimates[message.sample] = message

    def add_hammer(self, message: HammerEstimate) -> None:
        """Keep what is known of the hammer in place of what was."""
        self._hammer = message

    def add_comparison(self, message: ModelComparison) -> None:
        """Keep a comparison in place of the one before with the same model."""
        with self._lock:
            models = self._comparisons.setdefault(message.sample, {})
            models.pop(message.model, None)
            models[message.model] = message

    def make_results(self) -> Results:
        """Return what is known now."""
        with self._lock:
            hammer, hits = self._hammer, tuple(self._hits.values())
            estimates = dict(self._estimates)
        setup = setup_results_from_setup(self.setup)
        return Results(
            setup=setup,
            hammer=HammerResults() if hammer is None else result_from_msg(HammerResults, hammer),
            samples=tuple(
                result_from_msg(SampleResults, estimates[sample.name])
                for sample in setup.samples
                if sample.name in estimates
            ),
            hits=hits,
        )

    def make_traces(self, sample: str) -> SampleTraces:
        """Return the traces of one sample as they are known now; errors as they are joined."""
        with self._lock:
            comparisons = tuple(self._comparisons[sample].values())
            estimate = self._estimates.get(sample)
        return sample_traces_from_msgs(comparisons, estimate)


def _keep(table: OrderedDict[HitLabel, Any], label: HitLabel, value: Any) -> None:
    table[label] = value
    while len(table) > LARGEST_CAMPAIGN:
        table.popitem(last=False)
