"""The ledger of a campaign: every record is judged once, and only if it is stored."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from impact_rig_msgs.msg import AccelerationBlock, RecordStored

from impact_rig.core.given.errors import RigError
from impact_rig.core.given.records import Block
from impact_rig.core.hit.judging import JudgedHit
from impact_rig.core.hit.overrules import NO_OVERRULES, Overrules
from impact_rig.core.session import Session
from impact_rig.nodes.identity import id_from_msg
from impact_rig.recordings.messages import BLOCK_TYPE, OVERRULE_TYPE, block_from_msg
from impact_rig.recordings.run import read_overrules
from impact_rig.recordings.scan import Scan
from impact_rig.recordings.schemas import decode_message
from impact_rig.recordings.source import list_parts

Key = tuple[bytes, int]
"""The stream and the number of a record: no other record of a campaign has both."""


def find_key(message: AccelerationBlock | RecordStored) -> Key:
    """Return which record a message is of."""
    return id_from_msg(message.stream_id), message.record


@dataclass
class Ledger:
    """Gives the records of one campaign to its session, each once, when it is stored."""

    session: Session  # which judges, counts and estimates
    # Where the hits are recorded, on the recorder's host; empty: nowhere, and blocks are judged as
    # they come.
    recording: str = ""
    newest_record: int = 0
    _known: set[Key] = field(default_factory=set)
    _waiting: dict[Key, list[Block]] = field(default_factory=dict)
    _stored: dict[Key, int] = field(default_factory=dict)
    _cut: Key | None = None

    @property
    def waiting_record(self) -> int:
        """The first whole record that waits for the recorder's word; 0: none."""
        for (_, record), blocks in self._waiting.items():
            if blocks[-1].last:
                return record
        return 0

    @property
    def is_behind(self) -> bool:
        """Whether the blocks of a stored record have not all arrived here."""
        return bool(self._stored)

    def add_block(self, key: Key, block: Block) -> tuple[JudgedHit, ...]:
        """Take a block of a record; return the hits that are judged now.

        Without a recording, a record that comes a second time is the first of another pass.
        """
        if not self.recording:
            if key in self._known:
                self._clear()  # A replay begins again.
            return self._feed(key, [block])
        if key in self._known:
            return ()
        self._waiting.setdefault(key, []).append(block)
        return self._judge_stored(key)

    def add_stored(self, message: RecordStored) -> tuple[JudgedHit, ...]:
        """Note that a record is stored; return the hits that are judged now."""
        key = find_key(message)
        if key in self._known or not message.blocks:
            return ()
        self._stored[key] = message.blocks
        return self._judge_stored(key)

    def judge_incomplete(self) -> tuple[JudgedHit, ...]:
        """Judge stored records by the blocks that have come: the recording is elsewhere."""
        hits: list[JudgedHit] = []
        for key in tuple(self._stored):
            hits += self._judge(key)
        return tuple(hits)

    def read(self, campaign_id: bytes, namespace: str) -> str | None:
        """Judge the campaign's records in the run's recordings, each once.

        Parameters
        ----------
        campaign_id : bytes
            Of the campaign.
        namespace : str
            Of the rig.

        Returns
        -------
        str or None
            Why not all could be read; None: it was, or the recordings are on another computer.
        """
        self._clear()
        problem = self._read_overrules(campaign_id, namespace)
        record: list[Block] = []
        key: Key | None = None
        for path in self._list_parts():
            try:
                for found, block in _read_blocks(path, campaign_id, namespace):
                    if found in self._known:
                        continue
                    if key is not None and found != key:
                        self._feed(key, record)
                        record = []
                    key = found
                    record.append(block)
            except RigError as error:
                problem = str(error)
        if key is not None and record[-1].last:
            self._feed(key, record)
        elif key is not None:
            # The rest of it is still on its way, or will never come.
            self._waiting[key], self._cut = record, key
        return problem

    def _list_parts(self) -> list[Path]:
        return [path for path in list_parts(Path(self.recording)) if path.exists()]

    def _read_overrules(self, campaign_id: bytes, namespace: str) -> str | None:
        """Read the persons' verdicts in the recordings; return why not all could be read."""
        prefix = namespace.rstrip("/") + "/"
        newer = self.session.overrules.recorded
        try:
            recorded = read_overrules(
                map(Scan, self._list_parts()),
                lambda channel: (
                    channel.type_name == OVERRULE_TYPE and channel.topic.startswith(prefix)
                ),
                lambda raw, convert: convert(decode_message(raw)),
            )
        except RigError as error:
            return str(error)
        ours = recorded.get(campaign_id, NO_OVERRULES).recorded
        overrules = Overrules(recorded={**ours, **newer})
        self.session = Session(self.session.setup, overrules, keeps_hits=True)
        return None

    def _clear(self) -> None:
        # A replay that begins again says again what persons made of its hits.
        overrules = self.session.overrules if self.recording else NO_OVERRULES
        self.session = Session(self.session.setup, overrules, keeps_hits=True)
        for memory in (self._known, self._waiting, self._stored):
            memory.clear()
        self.newest_record, self._cut = 0, None

    def _judge_stored(self, key: Key) -> tuple[JudgedHit, ...]:
        if self._stored.get(key) != len(self._waiting.get(key, ())):
            return ()
        return self._judge(key)

    def _judge(self, key: Key) -> tuple[JudgedHit, ...]:
        del self._stored[key]
        cut, self._cut = self._cut, None
        if cut is not None and cut != key:
            self._feed(cut, self._waiting.pop(cut))
        blocks = self._waiting.pop(key, [])
        return self._feed(key, blocks) if blocks else ()

    def _feed(self, key: Key, blocks: list[Block]) -> tuple[JudgedHit, ...]:
        if self.recording or blocks[-1].last:
            self._known.add(key)
        self.newest_record = max(self.newest_record, key[1])
        return tuple(hit for block in blocks for hit in self.session.feed(block))


def _read_blocks(path: Path, campaign_id: bytes, namespace: str) -> Iterator[tuple[Key, Block]]:
    """Yield the blocks of a campaign in a recording; of a damaged one those before that."""
    prefix = namespace.rstrip("/") + "/"
    for raw in Scan(path).read_messages(
        lambda channel: channel.type_name == BLOCK_TYPE and channel.topic.startswith(prefix)
    ):
        message = decode_message(raw)
        if id_from_msg(message.campaign_id) == campaign_id:
            yield find_key(message), block_from_msg(message)
