"""What `impact-rig recover` prints: what was saved, what was lost, and where it is."""

from typing import Any

from rich.console import Console
from rich.text import Text

from impact_rig.cli.recordings.contents_report import contents_to_json, count, describe_hits
from impact_rig.cli.recordings.contents_view import print_incomplete_hits
from impact_rig.recording.recovery.contents import Contents
from impact_rig.recording.recovery.recovery import Recovery
from impact_rig.reporting.terminal.columns import Column
from impact_rig.reporting.terminal.console import ALARM, GOOD, print_table


def print_recovery(console: Console, recovery: Recovery) -> None:
    """Print what became of a recording."""
    contents = recovery.contents
    if recovery.output is None:
        console.print(
            Text(f"{contents.path}: nothing is wrong with it: {describe_hits(contents)}")
        )
        return
    console.print(Text(f"{contents.path}: {'; '.join(contents.problems)}", style="bold"))
    console.print(Text(f"saved: {describe_hits(contents)}"))
    saved = f"{count(recovery.written, 'message')} in {recovery.output}"
    # A path in two pieces is of no use to anybody.
    console.print(Text(f"       {saved}", style=GOOD), soft_wrap=True)
    unread = sum(file.unread for file in contents.files)
    if recovery.is_complete:
        console.print(Text("lost:  nothing that was in it"))
    else:
        console.print(Text(f"lost:  {_describe_loss(contents, unread)}", style=ALARM))
    if contents.unverified:
        console.print(Text(_describe_unverified(recovery)))
    console.print()
    print_incomplete_hits(console, contents)
    _print_losses(console, contents)


def recovery_to_json(recovery: Recovery) -> dict[str, Any]:
    """Return what became of a recording as plain values."""
    return {
        "output": None if recovery.output is None else str(recovery.output),
        "complete": recovery.is_complete,
        "messages_written": recovery.written,
        "unverified_kept": {
            topic: list(numbers) for topic, numbers in recovery.unverified.items()
        },
        "found": contents_to_json(recovery.contents),
    }


def _describe_loss(contents: Contents, unread: int) -> str:
    parts = [f"{unread} byte could not be read"] if unread else []
    if contents.lost:
        parts.append(f"at least {count(contents.lost, 'message')}")
    if contents.missing_files:
        parts.append(f"what was in {', '.join(contents.missing_files)}")
    return ", ".join(parts) or "nothing but what no checksum vouches for"


def _describe_unverified(recovery: Recovery) -> str:
    number = count(recovery.contents.unverified, "message")
    if recovery.unverified:
        return (
            f"kept:  {number} that fit their type although no checksum vouches for them: the"
            " new recording lists them"
        )
    return (
        f"left:  {number} that fit their type, but no checksum vouches for them:"
        " --keep-unverified keeps them"
    )


def _print_losses(console: Console, contents: Contents) -> None:
    topics = [topic for topic in contents.topics if topic.lost or topic.unverified]
    if topics:
        print_table(
            console,
            "Topics with losses",
            [
                Column("Topic", [topic.name for topic in topics], is_text=True),
                Column("Saved", [str(topic.messages) for topic in topics]),
                Column("Unverified", [str(topic.unverified) for topic in topics]),
                Column("Lost", [str(topic.lost) for topic in topics]),
            ],
        )
