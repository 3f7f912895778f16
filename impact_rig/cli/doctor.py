"""`impact-rig doctor`: what is installed, what is broken, what to do about it."""

import os
from collections.abc import Sequence
from pathlib import Path

import click
from rich.console import Console
from rich.table import Table
from rich.text import Text

from impact_rig.cli.checks.findings import Finding, Status
from impact_rig.cli.checks.host_checks import check_disk, check_shared_memory
from impact_rig.cli.checks.ros_checks import (
    check_conversation,
    check_discovery,
    check_distribution,
    check_domain,
)
from impact_rig.cli.checks.software_checks import check_libraries, check_python
from impact_rig.reporting.terminal.console import ALARM, GOOD, WARNING, make_console
from impact_rig.results.results_file import format_json

EXIT_FAULT = 1
STYLES = {Status.OK: GOOD, Status.WARNING: WARNING, Status.FAULT: ALARM}


@click.command(
    "doctor",
    epilog="""
    \b
    Examples:
      impact-rig doctor
      impact-rig doctor --json
    Exit code: 0 if the rig can work, 1 if something that it needs is broken.
    """,
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON, for programs.")
def command(as_json: bool) -> None:
    """See what is installed and what is broken.

    Looks at Python and its libraries, at ROS 2 and its settings, at disk and shared memory, and
    lets two processes exchange a message. Each line is ok, a warning or a fault, with what to do
    about it.
    """
    findings = examine()
    is_healthy = all(finding.status is not Status.FAULT for finding in findings)
    if as_json:
        click.echo(format_json(_to_json(findings, is_healthy)), nl=False)
    else:
        _print_findings(make_console(), findings)
    if not is_healthy:
        raise SystemExit(EXIT_FAULT)


def examine() -> list[Finding]:
    """Run every check."""
    return [
        check_python(),
        *check_libraries(),
        check_distribution(os.environ),
        check_domain(os.environ),
        check_discovery(os.environ),
        *check_conversation(),
        check_disk(Path.cwd()),
        check_shared_memory(),
    ]


def _to_json(findings: Sequence[Finding], is_healthy: bool) -> dict[str, object]:
    return {
        "healthy": is_healthy,
        "findings": [
            {
                "name": finding.name,
                "status": finding.status.value,
                "text": finding.text,
                "advice": finding.advice,
            }
            for finding in findings
        ],
    }


def _print_findings(console: Console, findings: Sequence[Finding]) -> None:
    table = Table.grid(padding=(0, 2, 0, 0))
    for finding in findings:
        found = Text(finding.text, overflow="fold")
        if finding.advice:
            found.append(f"\n{finding.advice}", style="bold")
        table.add_row(
            Text(finding.status.value, style=STYLES[finding.status]), Text(finding.name), found
        )
    console.print(table)
    console.print()
    counts = {
        status: sum(finding.status is status for finding in findings)
        for status in (Status.FAULT, Status.WARNING)
    }
    if not any(counts.values()):
        console.print("All is well.")
        return
    parts = [
        f"{count} {status.value}{'s' if count > 1 else ''}"
        for status, count in counts.items()
        if count
    ]
    console.print(f"{' and '.join(parts)}: see what to do above.")
