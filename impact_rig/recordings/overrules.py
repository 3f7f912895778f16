"""Persons' verdicts on hits, as a recording has them."""

from collections.abc import Callable, Iterable
from typing import Any

from impact_rig.core.given.errors import ParameterError
from impact_rig.core.hit.overrules import NO_OVERRULES, Overrule, Overrules, Verdict
from impact_rig.recordings.messages import PACKAGE, campaign_id_from_msg, stamp_from_msg
from impact_rig.recordings.records import Channel, RawMessage
from impact_rig.recordings.scan import Scan

OVERRULE_TYPE = PACKAGE + "Overrule"
LONGEST_TEXT = 200
"""Letters of a reason or a name that are kept, our choice."""


def overrule_from_msg(message: Any) -> Overrule:
    """Return a person's verdict on a hit.

    Raises
    ------
    ParameterError
        If the verdict is none.
    """
    if message.verdict > max(Verdict):
        known = ", ".join(f"{item.value} ({item.name.lower()})" for item in Verdict)
        raise ParameterError(f"verdict is {message.verdict}: it must be one of {known}")
    # On one line, whatever was typed.
    reason, who = (" ".join(text.split())[:LONGEST_TEXT] for text in (message.reason, message.who))
    stamp = stamp_from_msg(message.header.stamp)
    return Overrule(int(message.record), Verdict(message.verdict), reason, who, stamp)


def read_overrules(
    scans: Iterable[Scan],
    is_wanted: Callable[[Channel], bool],
    convert: Callable[[RawMessage, Callable[[Any], Any]], Any],
) -> dict[bytes, Overrules]:
    """Return the persons' verdicts that hold after all files, by campaign id.

    Parameters
    ----------
    scans : iterable of Scan
        The files of a run, in order.
    is_wanted : callable
        Whether a topic is the rig's.
    convert : callable
        Decodes a message and calls its second argument with it.
    """
    found: dict[bytes, Overrules] = {}
    for scan in scans:
        if not any(channel.type_name == OVERRULE_TYPE for channel in scan.read_channels()):
            continue
        for raw in scan.read_messages(
            lambda channel: channel.type_name == OVERRULE_TYPE and is_wanted(channel)
        ):
            key, overrule = convert(raw, _read)
            found[key] = found.get(key, NO_OVERRULES).add(overrule)
    return found


def _read(message: Any) -> tuple[bytes, Overrule]:
    return campaign_id_from_msg(message), overrule_from_msg(message)
