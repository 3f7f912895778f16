"""What is asked of a campaign, and what comes of it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from impact_rig_msgs.action import RunCampaign
from impact_rig_msgs.srv import GetResults

from impact_rig.core.setup.samples import RigSetup
from impact_rig.nodes import messages
from impact_rig.nodes.result_messages import result_from_msg
from impact_rig.results.campaign import Results
from impact_rig.results.estimates import HammerResults, SampleResults
from impact_rig.results.setup_results import SetupResults, setup_results_from_setup


@dataclass(frozen=True)
class CampaignRequest:
    """What to run.

    Attributes
    ----------
    samples : sequence of str
        Names, in this order; empty: the whole set.
    impacts : int
        Accepted hits per sample.
    attempts_per_impact : int
        Rejected hits in a row before giving up; 0: the campaign node's default.
    confirm_samples : bool
        Whether a person mounts each sample.
    keep_hits : int
        Of a sample's accepted hits, the most consistent are kept; 0: as the rig file says.
    """

    samples: Sequence[str] = ()
    impacts: int = 10
    attempts_per_impact: int = 0
    confirm_samples: bool = False
    keep_hits: int = 0


@dataclass(frozen=True)
class CampaignOutcome:
    """What came of a campaign.

    Attributes
    ----------
    success : bool
        Whether every sample has its hits.
    message : str
        Why not.
    results : Results
        What was found, up to where it ended.
    setup : RigSetup or None
        The rig; None: it never said.
    recording : str
        Path on the recorder's host; empty: nothing was recorded.
    """

    success: bool
    message: str
    results: Results
    setup: RigSetup | None
    recording: str


class Operator(Protocol):
    """Who sees what a campaign does, and has a hand in it."""

    def follow(self, feedback: Any) -> None:
        """See one feedback of the campaign action."""
        ...

    def mount(self, sample: str) -> None:
        """Mount a sample; return when it is."""
        ...

    def put_back(self, refusal: str) -> None:
        """Put the hammer back into its holder; return when it is there.

        Parameters
        ----------
        refusal : str
            Why it did not count as held after the last time; empty: this is the first.
        """
        ...

    def let_go(self, sample: str, patience: float) -> None:
        """Hear that the hammer may be let go by hand, within so many seconds."""
        ...


def results_from_msgs(
    result: RunCampaign.Result | GetResults.Response,
    setup: RigSetup | None,
    faults_by_record: dict[int, tuple[str, ...]],
) -> Results:
    """Return what came back over ROS as the results that leave the rig.

    Parameters
    ----------
    result : RunCampaign.Result or GetResults.Response
        What was found.
    setup : RigSetup or None
        That it was found with; None: not heard of.
    faults_by_record : dict of int to tuple of str
        Injected faults, as far as they are known.
    """
    hits = sorted([*result.accepted, *result.rejected], key=lambda hit: hit.record)
    return Results(
        setup=SetupResults() if setup is None else setup_results_from_setup(setup),
        hammer=result_from_msg(HammerResults, result.hammer),
        samples=tuple(result_from_msg(SampleResults, each) for each in result.samples),
        hits=tuple(
            messages.hit_results_from_msg(hit, faults_by_record.get(hit.record, ()))
            for hit in hits
        ),
    )
