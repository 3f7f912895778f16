"""Runs a campaign on one sample of a rig that is up, and counts; a process of its own.

Called with the sample and the number of hits. Prints hits and rejections so far as a line of JSON
after each hit: no view, which would cost as much as a node.
"""

import json
import sys
from typing import Any

from impact_rig.nodes.campaign_client import CampaignClient
from impact_rig.nodes.campaigning.request import CampaignRequest

START_TIMEOUT = 60.0
"""How long the rig may take to start [s]."""


class Counter:
    """Prints what each feedback counts; on the virtual rig nobody has anything to do."""

    def follow(self, feedback: Any) -> None:
        """Print one feedback of the campaign."""
        print(json.dumps({"hits": feedback.impact, "rejected": feedback.rejected}), flush=True)

    def mount(self, sample: str) -> None:
        """Do nothing."""

    def put_back(self, refusal: str) -> None:
        """Do nothing."""

    def let_go(self, sample: str, patience: float) -> None:
        """Do nothing."""


def main(sample: str, impacts: str) -> None:
    """Run the campaign to its end."""
    with CampaignClient() as client:
        client.wait_for_rig(START_TIMEOUT)
        request = CampaignRequest((sample,), int(impacts))
        outcome = client.run(request, Counter())
    if not outcome.success:
        raise SystemExit(outcome.message)


if __name__ == "__main__":
    main(*sys.argv[1:])
