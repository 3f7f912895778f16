"""Report of a node, once a second: its health, figures and parameters."""

import json
import platform
from collections.abc import Iterable, Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.parameter import Parameter

DIAGNOSTIC_PERIOD = 1.0
"""Time between two diagnostic messages of a node [s]."""
PARAMETERS = "parameters"
"""A node's diagnostics have a second status of this name: its parameters in JSON, and, as its
message, the id of its campaign."""


def make_diagnostics(
    node: str,
    figures: Mapping[str, Any],
    *,
    fault: str | None,
    warning: str | None,
    state: str,
    parameters: Iterable[Parameter],
    campaign_id: bytes,
) -> DiagnosticArray:
    """Return the diagnostics of a node of this full name, without a stamp."""
    level, message = DiagnosticStatus.OK, state
    if fault is not None:
        level, message = DiagnosticStatus.ERROR, fault
    elif warning is not None:
        level, message = DiagnosticStatus.WARN, warning
    host = platform.node()
    values = [KeyValue(key=key, value=str(value)) for key, value in figures.items()]
    settings = [
        KeyValue(key=item.name, value=json.dumps(item.value, ensure_ascii=False))
        for item in parameters
    ]
    health = DiagnosticStatus(
        name=node, hardware_id=host, level=level, message=message, values=values
    )
    settled = DiagnosticStatus(
        name=f"{node}/{PARAMETERS}", hardware_id=host, message=campaign_id.hex(), values=settings
    )
    return DiagnosticArray(status=[health, settled])
