"""Quality of service of a recorded topic, in the YAML that rosbag2 keeps with each channel."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import yaml

DEFAULT_DEPTH = 10
"""History depth where a recording does not tell it; the default of ROS 2."""

INFINITE = 2**63 - 1
"""How ROS 2 writes a duration without limit [ns]."""

LONGEST_TEXT = 1 << 16
"""Longer texts are not read [characters], our choice: a hundred publishers of one topic."""

KNOWN_TEXTS = 100
"""How many texts are known once they were read [-], our choice: YAML takes 3 ms for one."""

_HISTORIES = {1: "keep_last", 2: "keep_all"}
_RELIABILITIES = {1: "reliable", 2: "best_effort"}
_DURABILITIES = {1: "transient_local", 2: "volatile"}
"""Numbers of rmw's enumerations, which rosbag2 wrote before Jazzy."""


@dataclass(frozen=True)
class OfferedQos:
    """What a publisher of a topic offered, as far as it decides who receives what.

    Attributes
    ----------
    reliability : str
        "reliable" or "best_effort".
    durability : str
        "volatile" or "transient_local".
    history : str
        "keep_last", "keep_all" or "unknown": a publisher's history is not told to others.
    depth : int
        Of the history [messages]; 0: not known.
    lifespan : int
        How long a message is worth delivering [ns].
    """

    reliability: str = "reliable"
    durability: str = "volatile"
    history: str = "keep_last"
    depth: int = DEFAULT_DEPTH
    lifespan: int = INFINITE


def describe_offered_qos(profiles: tuple[OfferedQos, ...]) -> list[dict[str, Any]]:
    """Return offers as `metadata.yaml` of rosbag2 of ROS 2 Jazzy has them."""
    return [
        {
            "history": profile.history,
            "depth": profile.depth,
            "reliability": profile.reliability,
            "durability": profile.durability,
            "deadline": _describe_duration(INFINITE),
            "lifespan": _describe_duration(profile.lifespan),
            "liveliness": "automatic",
            "liveliness_lease_duration": _describe_duration(INFINITE),
            "avoid_ros_namespace_conventions": False,
        }
        for profile in profiles
    ]


def format_offered_qos(profiles: tuple[OfferedQos, ...]) -> str:
    """Return `offered_qos_profiles` as rosbag2 of ROS 2 Jazzy writes it."""
    return dump_yaml(describe_offered_qos(profiles)).rstrip() if profiles else ""


def dump_yaml(content: Any) -> str:
    """Return plain values as YAML, in their order."""
    # The same text five times as fast, where PyYAML was built with libyaml.
    dumper = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
    return str(yaml.dump(content, Dumper=dumper, sort_keys=False, allow_unicode=True))


@lru_cache(KNOWN_TEXTS)
def parse_offered_qos(text: str) -> tuple[OfferedQos, ...]:
    """Read `offered_qos_profiles` of any rosbag2 since Foxy.

    Parameters
    ----------
    text : str
        The YAML; empty: nothing was offered.

    Returns
    -------
    tuple of OfferedQos
        Empty where the text says nothing that can be understood: it only tells how to publish
        again, and is no reason to refuse a recording.
    """
    if len(text) > LONGEST_TEXT:
        return ()
    try:
        items = yaml.safe_load(text)
    except (yaml.YAMLError, RecursionError, ValueError):
        return ()
    if not isinstance(items, list):
        return ()
    return tuple(_parse_profile(item) for item in items if isinstance(item, dict))


def choose_qos(profiles: tuple[OfferedQos, ...]) -> OfferedQos:
    """Return the one profile that serves every subscriber the recorded publishers served.

    As rosbag2 does: what all offered, where they agree; where they differ, and where nothing is
    known, the default of ROS 2. The largest known depth is kept.
    """
    offers = {(profile.reliability, profile.durability) for profile in profiles}
    depth = max((profile.depth for profile in profiles), default=0) or DEFAULT_DEPTH
    if len(offers) != 1:
        return OfferedQos(depth=depth)
    reliability, durability = offers.pop()
    return OfferedQos(reliability, durability, "keep_last", depth)


def _describe_duration(nanoseconds: int) -> dict[str, int]:
    seconds, rest = divmod(nanoseconds, 1_000_000_000)
    return {"sec": seconds, "nsec": rest}


def _parse_duration(item: Any) -> int:
    if not isinstance(item, dict):
        return INFINITE
    seconds, rest = item.get("sec"), item.get("nsec")
    if not isinstance(seconds, int) or not isinstance(rest, int):
        return INFINITE
    return min(seconds * 1_000_000_000 + rest, INFINITE)


def _parse_profile(item: dict[str, Any]) -> OfferedQos:
    depth = item.get("depth", 0)
    return OfferedQos(
        reliability=_parse_policy(item.get("reliability"), _RELIABILITIES, "reliable"),
        durability=_parse_policy(item.get("durability"), _DURABILITIES, "volatile"),
        history=_parse_policy(item.get("history"), _HISTORIES, "unknown"),
        depth=depth if isinstance(depth, int) and depth > 0 else 0,
        lifespan=_parse_duration(item.get("lifespan")),
    )


def _parse_policy(value: Any, names: dict[int, str], default: str) -> str:
    name = names.get(value, default) if isinstance(value, int) else value
    return name if name in names.values() else default
