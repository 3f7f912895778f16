"""The ledger of a campaign: every record is judged once, and only if it is stored.

Blocks and the recorder's word come by two ways, in any order. A record of three blocks::

    blocks here    recorder's word     then
    1, 2, 3        none yet            it waits (`waiting_record`)
    1, 2, 3        "3 are stored"      it is judged
    1, 2           "3 are stored"      it is judged with its third block (`is_behind`)
    all or none    found by `read`     it is judged; what comes of it afterwards is dropped
    all or none    `read` finds 1, 2   its end may still come; as soon as another record is judged,
                                       it is judged as it is
"""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from itertools import groupby
from operator import itemgetter
from pathlib import Path

from impact_rig_msgs.msg import AccelerationBlock, RecordStored

from impact_rig.core.given.errors import RigError
from impact_rig.core.given.records import Block
from impact_rig.core.hit.judging import JudgedHit
from impact_rig.core.hit.overrules import NO_OVERRULES, Overrules
from impact_rig.core.session import Session
from impact_rig.nodes.identity import id_from_msg
from impact_rig.recordings.messages import BLOCK_TYPE, OVERRULE_TYPE, block_from_msg
from impact_rig.recordings.records import Channel
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
class _LedgerEntry:
    """One record: its blocks wait until as many are stored, then it is judged, once."""

    blocks: list[Block] = field(default_factory=list)  # that wait
    stored: int = 0  # how many are on the recorder's disk; 0: it has not said
    is_judged: bool = False


@dataclass
class Ledger:
    """Gives the records of one campaign to its session, each once, when it is stored."""

    session: Session  # which judges, counts and estimates
    # Where the hits are recorded, on the recorder's host; empty: nowhere, and blocks are judged as
    # they come.
    recording: str = ""
    newest_record: int = 0
    _records: dict[Key, _LedgerEntry] = field(default_factory=lambda: defaultdict(_LedgerEntry))
    # The last record that was read, if its end is not on the disk: it may still come.
    _cut: Key | None = None

    @property
    def waiting_record(self) -> int:
        """The first whole record that waits for the recorder's word; 0: none."""
        records = self._records.items()
        whole = (number for (_, number), it in records if it.blocks and it.blocks[-1].last)
        return next(whole, 0)

    @property
    def is_behind(self) -> bool:
        """Whether the blocks of a stored record have not all arrived here."""
        return any(record.stored for record in self._records.values())

    def add_block(self, key: Key, block: Block) -> tuple[JudgedHit, ...]:
        """Take a block of a record; return the hits that are judged now.

        Without a recording, a record that comes a second time is the first of another pass.
        """
        record = self._records[key]
        if not self.recording:
            if record.is_judged:
                self._clear()  # A replay begins again.
            return self._feed(key, [block])
        if record.is_judged:
            return ()
        record.blocks.append(block)
        return self._judge_stored(key)

    def add_stored(self, message: RecordStored) -> tuple[JudgedHit, ...]:
        """Note that a record is stored; return the hits that are judged now."""
        record = self._records[key := find_key(message)]
        if record.is_judged or not message.blocks:
            return ()
        record.stored = message.blocks
        return self._judge_stored(key)

    def judge_incomplete(self) -> tuple[JudgedHit, ...]:
        """Judge stored records by the blocks that have come: the recording is elsewhere."""
        stored = [key for key, record in self._records.items() if record.stored]
        return tuple(hit for key in stored for hit in self._judge(key))

    def read(self, campaign_id: bytes, namespace: str) -> str | None:
        """Judge a campaign's records in the run's recordings, each once.

        Return why not all could be read; None: it was, or they are on another computer.
        """
        self._clear()
        prefix, scans, problems = namespace.rstrip("/") + "/", list[Scan](), list[str]()
        for path in filter(Path.exists, list_parts(Path(self.recording))):
            try:
                scans.append(Scan(path))
            except RigError as error:
                problems.append(str(error))
        try:
            self._read_overrules(scans, campaign_id, prefix)
        except RigError as error:
            problems.append(str(error))
        found = _read_blocks(scans, campaign_id, prefix, problems)
        for key, pairs in groupby(found, itemgetter(0)):
            if self._records[key].is_judged:
                continue
            self._judge_cut(key)
            blocks = [block for _, block in pairs]
            if blocks[-1].last:
                self._feed(key, blocks)
            else:
                self._records[key].blocks, self._cut = blocks, key
        return problems[-1] if problems else None

    def _read_overrules(self, scans: list[Scan], campaign_id: bytes, prefix: str) -> None:
        """Begin with the persons' verdicts in the recordings."""
        newer = self.session.overrules.recorded
        recorded = read_overrules(
            scans,
            partial(_is_ours, OVERRULE_TYPE, prefix),
            lambda raw, convert: convert(decode_message(raw)),
        )
        ours = recorded.get(campaign_id, NO_OVERRULES).recorded
        overrules = Overrules(recorded={**ours, **newer})
        self.session = Session(self.session.setup, overrules)

    def _clear(self) -> None:
        # A replay that begins again says again what persons made of its hits.
        overrules = self.session.overrules if self.recording else NO_OVERRULES
        self.session = Session(self.session.setup, overrules)
        self._records.clear()
        self.newest_record, self._cut = 0, None

    def _judge_stored(self, key: Key) -> tuple[JudgedHit, ...]:
        record = self._records[key]
        return self._judge(key) if record.stored == len(record.blocks) else ()

    def _judge(self, key: Key) -> tuple[JudgedHit, ...]:
        self._judge_cut(key)
        record = self._records[key]
        record.stored = 0
        return self._feed(key, record.blocks) if record.blocks else ()

    def _judge_cut(self, following: Key) -> None:
        """Judge the record that was cut off as it is, if another one follows."""
        cut, self._cut = self._cut, None
        if cut is not None and cut != following:
            self._feed(cut, self._records[cut].blocks)

    def _feed(self, key: Key, blocks: list[Block]) -> tuple[JudgedHit, ...]:
        is_judged = bool(self.recording) or blocks[-1].last
        self._records[key] = _LedgerEntry(is_judged=is_judged)
        self.newest_record = max(self.newest_record, key[1])
        return tuple(hit for block in blocks for hit in self.session.feed(block))


def _is_ours(type_name: str, prefix: str, channel: Channel) -> bool:
    return channel.type_name == type_name and channel.topic.startswith(prefix)


def _read_blocks(
    scans: list[Scan], campaign_id: bytes, prefix: str, problems: list[str]
) -> Iterator[tuple[Key, Block]]:
    """Yield the blocks of a campaign; of a damaged file those before that, and why."""
    for scan in scans:
        try:
            for raw in scan.read_messages(partial(_is_ours, BLOCK_TYPE, prefix)):
                message = decode_message(raw)
                if id_from_msg(message.campaign_id) == campaign_id:
                    yield find_key(message), block_from_msg(message)
        except RigError as error:
            problems.append(str(error))
