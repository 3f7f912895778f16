"""A whole campaign as a user runs it, from the command to the printed tables."""

from impact_rig.bench.figures import Figure, at_most
from impact_rig.bench.part import Bench, Part

LONGEST_TIME = 20.0
"""Of a campaign [s], as asked for."""


def measure(bench: Bench) -> tuple[Figure, ...]:
    """Run campaigns one after the other."""
    campaigns = bench.campaigns.take(bench.extent.demos, bench.report)
    return (
        Figure(
            "impact-rig demo",
            tuple(campaign.seconds for campaign in campaigns),
            "s",
            at_most(LONGEST_TIME),
            note="120 hits on twelve samples, seven processes, from the command to its end",
        ),
    )


PART = Part("demo", "The paper's campaign on the virtual rig, start to tables", measure, 20.0)
