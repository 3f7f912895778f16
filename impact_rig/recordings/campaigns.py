"""Where a campaign begins: the one rule for recordings, replays and live nodes."""

from dataclasses import dataclass, field
from typing import Any

from impact_rig.recordings.fields import NO_ID, stamp_from_msg
from impact_rig.recordings.messages import campaign_id_from_msg


def begins_campaign(setup: Any, current: bytes | None) -> bool:
    """Return whether a set-up's message begins a campaign.

    The first set-up does: hits that came before it are its own. A later one without a stamp is of
    a campaign node that has just started. One with the id of the running campaign repeats it, as
    each recording of a resumed run does; without ids there is none to compare.

    Parameters
    ----------
    setup : object
        A `RigSetup` message, of any decoder.
    current : bytes or None
        Id of the campaign so far; None: no set-up has come.
    """
    if current is None:
        return True
    campaign = campaign_id_from_msg(setup)
    return stamp_from_msg(setup.header.stamp) > 0 and not campaign == current != NO_ID


def is_trial(setup: Any) -> bool:
    """Return whether a set-up's message is of a campaign whose hits do not count.

    Older recordings have no trials.
    """
    return bool(getattr(setup.plan, "trial", False))


@dataclass
class CampaignWatch:
    """Follows the campaigns of one rig through the messages of its recordings."""

    campaign: bytes | None = None  # id of the running one; None: no set-up has come
    repeated: int = 0  # blocks that have come a second time
    is_trial: bool = False  # the newest set-up is of one that does not count
    _known: set[int] = field(default_factory=set)  # hashes of the campaign's blocks

    def add_setup(self, setup: Any) -> bool:
        """Take a set-up's message; return whether it begins a campaign that counts."""
        self.is_trial = is_trial(setup)
        if self.is_trial or not begins_campaign(setup, self.campaign):
            return False
        self.campaign = campaign_id_from_msg(setup)
        self._known.clear()
        return True

    def add_block(self, data: bytes) -> bool:
        """Take a block as it is in the file; return whether it counts, and is there first.

        Where two recorders were merged, or a recording was copied into its run, there are two.
        """
        if self.is_trial:
            return False
        is_new = (key := hash(data)) not in self._known
        self.repeated += not is_new
        self._known.add(key)
        return is_new
