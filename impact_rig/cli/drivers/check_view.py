"""What `impact-rig devices --check` prints of a rig's devices."""

from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from impact_rig.cli.drivers.rig_check import DeviceCheck
from impact_rig.reporting.terminal.columns import make_printable
from impact_rig.reporting.terminal.console import ALARM, GOOD, print_text

FAULT = "fault"
OK = "ok"


def print_checks(console: Console, checks: Sequence[DeviceCheck], warnings: Sequence[str]) -> None:
    """Print what was found of each device, then what is to be known of the sensors."""
    for check in checks:
        state = Text(FAULT, ALARM) if check.trouble else Text(OK, GOOD)
        console.print(Text.assemble(state, f"  {check.part}"))
        table = Table.grid(padding=(0, 2, 0, 0))
        for name, text in check.facts:
            table.add_row(Text(f"  {name}"), Text(make_printable(text), overflow="fold"))
        if check.trouble:
            table.add_row("", Text(make_printable(check.trouble), overflow="fold"))
        console.print(table)
        console.print()
    for text in warnings:
        print_text(console, Text.assemble(("warning: ", ALARM), make_printable(text)))


def checks_to_json(checks: Sequence[DeviceCheck], warnings: Sequence[str]) -> dict[str, Any]:
    """Return the same as plain values."""
    content: dict[str, Any] = {
        check.part: {**dict(check.facts), "trouble": check.trouble} for check in checks
    }
    return {**content, "warnings": list(warnings)}
