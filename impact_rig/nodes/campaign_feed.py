"""Findings of a rig's campaigns, for a display, which may come at any time."""

from collections import deque
from collections.abc import Callable
from typing import Any

from impact_rig.core.given.setup import RigSetup
from impact_rig.nodes.intake import Received
from impact_rig.recordings.campaigns import begins_campaign


class CampaignFeed:
    """Passes on the set-up of each campaign, then the findings of that campaign.

    They come by several topics: a finding may come before its set-up, and waits for that. `begin`
    gets the set-up that begins a campaign, `take` each finding of it.
    """

    def __init__(
        self,
        begin: Callable[[Received[RigSetup]], None],
        take: Callable[[Received[Any]], None],
    ) -> None:
        self._begin, self._take = begin, take
        self.campaign_id: bytes | None = None  # of that under way; None: no set-up has come
        self._early: deque[Received[Any]] = deque(maxlen=1000)  # more than the topics keep

    def on_setup(self, received: Received[RigSetup]) -> None:
        """Begin a campaign, unless the set-up repeats that of the one under way."""
        if not begins_campaign(received.message, self.campaign_id):
            return
        self.campaign_id = received.identity.campaign_id
        self._begin(received)
        early = tuple(self._early)
        self._early.clear()
        for waiting in early:
            self.on_finding(waiting)

    def on_finding(self, received: Received[Any]) -> None:
        """Pass a finding on, or keep it until its set-up comes."""
        if received.identity.campaign_id == self.campaign_id:
            self._take(received)
        else:
            self._early.append(received)
