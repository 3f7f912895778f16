"""The ledger and its session say what an analysis of the recording says, whatever came between."""

import json
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np
from builtin_interfaces.msg import Time
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from impact_rig_msgs.msg import RecordStored
from rclpy.serialization import serialize_message

from impact_rig.core.given.errors import ParameterError
from impact_rig.core.given.records import SIMULATED, Block, ChannelBlock, HitLabel, Origin
from impact_rig.core.hit.overrules import NO_OVERRULES, Overrule, Overrules, Verdict
from impact_rig.core.session import Session
from impact_rig.nodes import interfaces
from impact_rig.nodes.identity import Identity, make_id
from impact_rig.nodes.ledger import Ledger
from impact_rig.nodes.messages import block_to_msg
from impact_rig.nodes.result_messages import overrule_to_msg
from impact_rig.recordings.schemas import find_message_definition
from impact_rig.recordings.writer import RecordingWriter
from impact_rig.results.campaign import results_from_session
from impact_rig.results.wire import to_json

from ..core.blocks import FULL_SCALE, SETUP, make_counts

RATE, PLACE, BLOCKS = 1e6, 300, 3
HEIGHTS = (900.0, -346.0, 150.0, -65.0, 28.0)
OURS = Identity(make_id(), make_id())


@dataclass(frozen=True)
class Strike:
    """A hit, and how it comes to the estimator."""

    sample: str
    height: float = 900.0  # 150: too weak
    rate: float = RATE
    is_simulated: bool = False
    is_stored_first: bool = False  # the recorder's word comes before the blocks
    is_block_lost: bool = False  # on the way to the estimator


PAUSE, QUESTION, RESTART = "pause", "question", "restart"
STRIKES = st.builds(
    Strike,
    st.sampled_from(["alike", "heavy"]),
    st.sampled_from([900.0, 900.0, 893.0, 907.0, 150.0]),
    st.sampled_from([RATE, RATE, RATE, 1.25e6]),
    is_simulated=st.sampled_from([False, False, False, True]),
    is_stored_first=st.booleans(),
    is_block_lost=st.sampled_from([False, False, False, True]),
)


@cache
def make_hit(strike: Strike, record: int) -> tuple[Block, ...]:
    """Return a hit of 200 points that the sample answers with a decaying wave."""
    hammer = make_counts([(PLACE, strike.height)], 1500, seed=record)
    swings = [(PLACE + 150 * swing, height) for swing, height in enumerate(HEIGHTS)]
    channels = [
        ChannelBlock(counts.astype(np.int32), scale * FULL_SCALE / 2048, 0.0, FULL_SCALE)
        for counts, scale in ((hammer, 1.0), (make_counts(swings, 1500, seed=1000 + record), -1.0))
    ]
    origin = Origin(SIMULATED if strike.is_simulated else "measured")
    label = HitLabel(strike.sample, record, record)
    whole = Block(0, strike.rate, channels[0], channels[1], label, last=True, origin=origin)
    return tuple(whole.cut(500 * part, 500 * (part + 1)) for part in range(BLOCKS))


@dataclass
class Rig:
    """A recorder and an estimator, without their nodes."""

    folder: Path
    record: int = 0
    blocks: list[Block] = field(default_factory=list)  # in the order of recording
    overrules: Overrules = NO_OVERRULES

    def __post_init__(self) -> None:
        self.parts = 0
        self.start()

    def start(self) -> None:
        """Go on as after a kill: another file of the run, another ledger that reads them all."""
        self.parts += 1
        name = "session.mcap" if self.parts == 1 else f"session-{self.parts}.mcap"
        self.writer = RecordingWriter(self.folder / name)
        topic = interfaces.ACCELERATION
        definition = find_message_definition(topic.type_name)
        self.channel = self.writer.add_channel(f"/{topic.name}", definition, ())
        definition = find_message_definition(interfaces.OVERRULE.type_name)
        self.verdicts = self.writer.add_channel("/overrule", definition, ())
        self.ledger = Ledger(Session(SETUP), str(self.folder / name))
        self.read()

    def read(self) -> None:
        self.writer.flush()
        self.ledger.read(OURS.campaign_id, "/")

    def strike(self, strike: Strike) -> None:
        self.record += 1
        blocks = make_hit(strike, self.record)
        self.blocks += blocks
        for block in blocks:
            data = serialize_message(block_to_msg(block, OURS))
            self.writer.add_message(self.channel, data, 1, 1)
        stored = RecordStored(record=self.record, blocks=len(blocks))
        OURS.fill(stored)
        if strike.is_stored_first:
            self.ledger.add_stored(stored)
        for block in blocks[strike.is_block_lost :]:
            self.ledger.add_block((OURS.stream_id, self.record), block)
        if not strike.is_stored_first:
            assert self.ledger.waiting_record == self.record
            self.ledger.add_stored(stored)
        assert self.ledger.is_behind == strike.is_block_lost
        if self.ledger.is_behind:
            self.read()

    def overrule(self, overrule: Overrule) -> None:
        try:
            self.ledger.session.overrule(overrule)
        except ParameterError:
            return
        self.overrules = self.overrules.add(overrule)
        data = serialize_message(overrule_to_msg(overrule, OURS, Time()))
        self.writer.add_message(self.verdicts, data, 1, 1)

    def follow(self, action: Strike | Overrule | str) -> None:
        session = self.ledger.session
        if isinstance(action, Strike):
            self.strike(action)
        elif isinstance(action, Overrule):
            self.overrule(action)
        elif action == PAUSE:
            for name in session.names:
                session.estimate_sample(name)
        elif action == QUESTION:
            check_counts(session)
        else:
            self.writer.close()
            self.start()


def check_counts(session: Session) -> None:
    """Hold what a campaign ends by against what it then shows."""
    results = session.estimate_all()
    counts = session.count_hits()
    for sample in results.samples:
        count = counts[sample.name]
        assert count.kept == sample.impacts_accepted
        assert count.left_out == sample.impacts_rejected
    assert sum(count.kept for count in counts.values()) == len(results.accepted)


def write_results(session: Session) -> str:
    return json.dumps(to_json(results_from_session(session.estimate_all(), {})))


def analyze(blocks: list[Block], overrules: Overrules) -> str:
    session = Session(SETUP, overrules)
    for block in blocks:
        session.feed(block)
    return write_results(session)


OVERRULES = st.builds(Overrule, st.integers(1, 8), st.sampled_from(Verdict), st.just("loose"))


# A sequence is short enough to be read: to make it shorter takes minutes.
@settings(max_examples=20, phases=(Phase.generate,))
@given(
    st.lists(
        st.one_of(
            STRIKES, STRIKES, STRIKES, OVERRULES, st.sampled_from([PAUSE, QUESTION, RESTART])
        ),
        min_size=3,
        max_size=12,
    )
)
def test_the_same_hits_give_the_same_bytes(tmp_path_factory, actions):
    rig = Rig(tmp_path_factory.mktemp("run"))
    for action in actions:
        rig.follow(action)
    check_counts(rig.ledger.session)
    live = write_results(rig.ledger.session)
    rig.follow(RESTART)
    assert live == analyze(rig.blocks, rig.overrules) == write_results(rig.ledger.session)
    rig.writer.close()


def test_where_nothing_is_recorded_a_pass_that_begins_again_is_judged_anew():
    ledger = Ledger(Session(SETUP))
    for _ in range(2):
        for record in (1, 2):
            for block in make_hit(Strike("alike"), record):
                ledger.add_block((OURS.stream_id, record), block)
        assert ledger.session.count_hits()["alike"].kept == ledger.newest_record == 2
