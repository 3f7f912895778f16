"""What the parts of the bench are called: light, since the help lists them."""

PARTS = (
    "start",
    "model",
    "hit",
    "write",
    "demo",
    "latency",
    "stop",
    "devices",
    "read",
    "view",
    "stream",
    "memory",
    "batch",
    "fuzz",
    "kill",
)
"""Modules of `impact_rig.bench.parts`, in the order in which they run: the quiet ones first."""
