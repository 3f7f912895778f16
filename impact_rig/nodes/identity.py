"""Whose a message is: the campaign that a node takes part in, or another; the one comparison.

Set-up, blocks, releases, verdicts, estimates and states carry the id of their campaign, blocks
that of the accelerometers' stream too. So a replay, a bag that is played into a live rig, a late
message and a second rig are distinguished without a clock.
"""

import uuid
from dataclasses import dataclass
from typing import Any

from builtin_interfaces.msg import Time
from impact_rig_msgs.msg import StreamBlock
from unique_identifier_msgs.msg import UUID

from impact_rig.recordings.fields import NO_ID


def make_id() -> bytes:
    """Return a new id."""
    return uuid.uuid4().bytes


def id_to_msg(identity: bytes) -> UUID:
    """Return an id as a message."""
    return UUID(uuid=list(identity))


def id_from_msg(message: UUID) -> bytes:
    """Return the id that a message carries."""
    return bytes(message.uuid)


@dataclass(frozen=True)
class Identity:
    """The ids that a message of the rig carries."""

    campaign_id: bytes = NO_ID
    stream_id: bytes = NO_ID

    def fill(self, message: Any, stamp: Time | None = None) -> Any:
        """Put the ids into a message, those that it has, and a stamp; return the message."""
        if hasattr(message, "campaign_id"):
            message.campaign_id = id_to_msg(self.campaign_id)
        if hasattr(message, "stream_id"):
            message.stream_id = id_to_msg(self.stream_id)
        if stamp is not None:
            message.header.stamp = stamp
        return message


NO_IDENTITY = Identity()
_NO_ID = UUID()


def identity_from_msg(message: Any) -> Identity:
    """Return the ids of a message, those that it has."""
    return Identity(*(
        id_from_msg(getattr(message, name, _NO_ID)) for name in ("campaign_id", "stream_id")
    ))  # fmt: skip


class Membership:
    """The campaign that a node takes part in.

    A node that no campaign has asked to join follows the set-ups that it receives, those of a
    replay, and takes everything.
    """

    def __init__(self) -> None:
        self.identity = Identity()
        self.is_joined = False

    def join(self, identity: Identity) -> None:
        """Take part in a campaign; a stream that is not known yet is any."""
        self.identity, self.is_joined = identity, True

    def is_foreign(self, message: Any) -> bool:
        """Return whether a message is to be ignored."""
        if not self.is_joined or not hasattr(message, "campaign_id"):
            return False
        if id_from_msg(message.campaign_id) == self.identity.campaign_id:
            return False
        # The running stream goes on while a campaign begins.
        if not isinstance(message, StreamBlock):
            return True
        return self.identity.stream_id not in (NO_ID, id_from_msg(message.stream_id))
