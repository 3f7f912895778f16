"""Holds the index after a chunk against the chunk, and counts what a broken chunk held."""

import struct
from collections import Counter, defaultdict

_HEAD = struct.Struct("<HI")
"""Channel, and length of the entries."""
_ENTRY = struct.Struct("<QQ")
"""Log time of a message and where it begins in the chunk."""


def read_message_index(content: bytes) -> tuple[int, list[tuple[int, int]]] | None:
    """Return the channel and the entries of a record; None: it is damaged."""
    if len(content) < _HEAD.size:
        return None
    channel, length = _HEAD.unpack_from(content)
    if length != len(content) - _HEAD.size or length % _ENTRY.size:
        return None
    return channel, list(_ENTRY.iter_unpack(content[_HEAD.size :]))


class MessageIndexCheck:
    """Takes chunks and the index records after them in turn.

    Attributes
    ----------
    existing : Counter
        Messages of each channel that are known to have been in the chunks so far.
    """

    def __init__(self) -> None:
        self.existing: Counter[int] = Counter()
        self._found: dict[int, list[tuple[int, int]]] = defaultdict(list)
        self._stated: Counter[int] = Counter()
        self._is_vouched = False

    def add_message(self, channel: int, log_time: int, place: int) -> None:
        """Count a message of the chunk, which begins at a place in it."""
        self._found[channel].append((log_time, place))

    def end_chunk(self, *, is_vouched: bool) -> None:
        """Say that the chunk's messages were all, and whether they are what was written."""
        self._is_vouched = is_vouched

    def check(self, content: bytes) -> bool:
        """Take an index record; tell whether it is sound and fits the chunk."""
        entry = read_message_index(content)
        if entry is None:
            return False
        channel, places = entry
        self._stated[channel] += len(places)
        return not self._is_vouched or sorted(places) == sorted(self._found.get(channel, []))

    def finish(self) -> None:
        """Say that no further index record follows on the chunk."""
        for channel in {*self._found, *self._stated}:
            found = len(self._found.get(channel, []))
            stated = 0 if self._is_vouched else self._stated[channel]
            self.existing[channel] += max(found, stated)
        self._found.clear()
        self._stated.clear()
        self._is_vouched = False
