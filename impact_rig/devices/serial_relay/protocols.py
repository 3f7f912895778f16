"""What a relay on a serial port is told, and what it may answer."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from impact_rig.configuration.toml_table import REQUIRED, TomlTable
from impact_rig.devices.hammer_holder import HolderState

START = 0xA0
"""First byte of every frame of the four-byte protocol, which the common USB relay boards speak:
start, channel, operation, and the sum of the three."""
OFF, ON = 0, 1
OFF_AND_ANSWER, ON_AND_ANSWER, QUERY = 2, 3, 5
"""Operations. The answer is a frame with `OFF` or `ON`; simple boards know the first two alone."""
FRAME_SIZE = 4
"""Of the four-byte protocol [byte]."""
LONGEST_CHANNEL = 16
"""Most relays on one board that speaks it [-]: those on sale have 1 to 16."""
RELEASES, HOLDS = "releases", "holds"
"""What an energized relay does."""


@dataclass(frozen=True)
class Exchange:
    """A request, and what may come back.

    Attributes
    ----------
    request : bytes
        To be sent.
    answers : mapping
        What the relay may answer, and what it does then; empty: it does not answer.
    """

    request: bytes
    answers: Mapping[bytes, HolderState] = field(default_factory=dict)


@dataclass(frozen=True)
class RelayProtocol:
    """How one relay is spoken to.

    Attributes
    ----------
    hold, release : Exchange
        Its commands.
    query : Exchange or None
        What it does; None: it cannot be asked.
    line_end : bytes
        Ends every answer; empty: answers have `FRAME_SIZE` bytes.
    """

    hold: Exchange
    release: Exchange
    query: Exchange | None = None
    line_end: bytes = b""


def make_frame(channel: int, operation: int) -> bytes:
    """Return a frame of the four-byte protocol."""
    return bytes((START, channel, operation, (START + channel + operation) & 0xFF))


def read_four_byte_protocol(options: TomlTable) -> RelayProtocol:
    """Return the protocol of the common USB relay boards.

    Parameters
    ----------
    options : TomlTable
        `channel`, `energized`, `answers`.

    Raises
    ------
    ParameterError
        If a value cannot be meant.
    """
    channel = options.take_whole("channel", 1, LONGEST_CHANNEL, 1)
    is_released_when_on = options.take_choice("energized", (RELEASES, HOLDS), RELEASES) == RELEASES
    states = {
        ON: HolderState.RELEASED if is_released_when_on else HolderState.HOLDING,
        OFF: HolderState.HOLDING if is_released_when_on else HolderState.RELEASED,
    }
    operations = {state: operation for operation, state in states.items()}
    if not options.take_boolean("answers", default=False):
        return RelayProtocol(
            hold=Exchange(make_frame(channel, operations[HolderState.HOLDING])),
            release=Exchange(make_frame(channel, operations[HolderState.RELEASED])),
        )
    answers = {make_frame(channel, operation): state for operation, state in states.items()}
    asking = {ON: ON_AND_ANSWER, OFF: OFF_AND_ANSWER}
    return RelayProtocol(
        hold=Exchange(make_frame(channel, asking[operations[HolderState.HOLDING]]), answers),
        release=Exchange(make_frame(channel, asking[operations[HolderState.RELEASED]]), answers),
        query=Exchange(make_frame(channel, QUERY), answers),
    )


def read_text_protocol(options: TomlTable) -> RelayProtocol:
    """Return a protocol of lines of text.

    Parameters
    ----------
    options : TomlTable
        `hold_command`, `release_command`, `answer`, `query_command`, `holding_answer`,
        `released_answer`, `line_end`.

    Raises
    ------
    ParameterError
        If a command is missing, or a value cannot be meant.
    """
    line_end = options.take_text("line_end", "\n").encode()
    if not line_end:
        raise options.refuse("line_end", 'what ends a line: "\\n", "\\r" or "\\r\\n"')
    hold = _take_line(options, "hold_command", "HOLD")
    release = _take_line(options, "release_command", "RELEASE")
    if hold == release:
        raise options.refuse("release_command", "another one than hold_command")
    answer = _take_line(options, "answer", "OK") if "answer" in options else b""
    query = None
    if "query_command" in options:
        answers = {
            _take_line(options, "holding_answer", "HOLDING"): HolderState.HOLDING,
            _take_line(options, "released_answer", "RELEASED"): HolderState.RELEASED,
        }
        if len(answers) == 1:
            raise options.refuse("released_answer", "another one than holding_answer")
        query = Exchange(_take_line(options, "query_command", "STATE?") + line_end, answers)
    return RelayProtocol(
        Exchange(hold + line_end, {answer: HolderState.HOLDING} if answer else {}),
        Exchange(release + line_end, {answer: HolderState.RELEASED} if answer else {}),
        query,
        line_end,
    )


def _take_line(options: TomlTable, key: str, example: str) -> bytes:
    """Return a line without its end."""
    text = options.take_text(key, REQUIRED, example)
    if not text.isascii() or not text.isprintable() or not text.strip():
        raise options.refuse(key, "one line of ASCII text")
    return text.encode("ascii")
