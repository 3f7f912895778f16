"""Checks of ROS 2: which one, what the environment says, and whether two processes can talk."""

import contextlib
import os
import subprocess
import sys
import time
import uuid
from collections.abc import Iterator, Mapping
from importlib import metadata, util

from impact_rig.cli.checks.findings import Finding, Status
from impact_rig.nodes.domain import reserve_domain

DISTRIBUTION = "jazzy"
PROBE_TIMEOUT = 20.0
"""How long two processes may take to find each other [s]: one or two, more on a busy host."""
DISCOVERY_RANGES = {
    "SUBNET": "the local network",
    "LOCALHOST": "this host",
    "SYSTEM_DEFAULT": "whatever the middleware does by itself",
    "OFF": "nothing",
}
HIGHEST_DOMAIN = 232
HIGHEST_SAFE_DOMAIN = 101
"""Above it the ports of a domain may collide with those that Linux hands out."""
UNSET = "unset"


def check_distribution(environment: Mapping[str, str]) -> Finding:
    """Tell which ROS 2 this is."""
    name = "ROS 2"
    chosen = environment.get("ROS_DISTRO", "")
    if chosen and chosen != DISTRIBUTION:
        return Finding(
            name,
            Status.FAULT,
            f"{chosen} is sourced (ROS_DISTRO)",
            f"source ROS 2 {DISTRIBUTION.title()}, or none: then it comes from PyPI",
        )
    if util.find_spec("rclpy") is None:
        return Finding(
            name,
            Status.FAULT,
            "none: there is no rclpy",
            "run `python3 launch_scripts/rig.py exec -- impact-rig doctor`, or source ROS 2"
            f" {DISTRIBUTION.title()}",
        )
    try:
        wheel = metadata.version("ros-rclpy")
    except metadata.PackageNotFoundError:
        origin = "installed on this machine"
    else:
        origin = f"wheels from PyPI (ros-rclpy {wheel})"
    return Finding(name, Status.OK, f"{DISTRIBUTION.title()}, {origin}")


def check_domain(environment: Mapping[str, str]) -> Finding:
    """Look at ROS_DOMAIN_ID."""
    name = "ROS_DOMAIN_ID"
    text = environment.get(name, "")
    if not text:
        return Finding(name, Status.OK, f"{UNSET}: domain 0; demo takes an unused one")
    if not text.isdecimal() or int(text) > HIGHEST_DOMAIN:
        return Finding(
            name,
            Status.FAULT,
            repr(text),
            f"unset it, or set a whole number from 0 to {HIGHEST_SAFE_DOMAIN}",
        )
    if int(text) > HIGHEST_SAFE_DOMAIN:
        return Finding(
            name,
            Status.WARNING,
            text,
            f"set a number up to {HIGHEST_SAFE_DOMAIN}: above it ports may be taken by others",
        )
    return Finding(name, Status.OK, text)


def check_discovery(environment: Mapping[str, str]) -> Finding:
    """Look at how far nodes search for each other."""
    name = "discovery"
    variable = "ROS_AUTOMATIC_DISCOVERY_RANGE"
    if environment.get("ROS_LOCALHOST_ONLY", "0") not in ("", "0"):
        return Finding(
            name,
            Status.WARNING,
            "ROS_LOCALHOST_ONLY is set: this host, whatever else is said",
            f"unset it and set {variable}=LOCALHOST instead: it is deprecated",
        )
    chosen = environment.get(variable, "")
    if not chosen:
        return Finding(name, Status.OK, f"{variable} {UNSET}: the rig stays on this host")
    if chosen not in DISCOVERY_RANGES:
        return Finding(
            name,
            Status.FAULT,
            f"{variable} is {chosen!r}",
            f"unset it, or set one of {', '.join(DISCOVERY_RANGES)}",
        )
    text = f"{variable}={chosen}: {DISCOVERY_RANGES[chosen]}"
    if chosen == "OFF":
        return Finding(
            name, Status.FAULT, text, "set LOCALHOST: not even the nodes of one host meet"
        )
    return Finding(name, Status.OK, text)


def check_conversation(timeout: float = PROBE_TIMEOUT) -> list[Finding]:
    """Let two processes of this host exchange a message, and tell the middleware they used.

    Parameters
    ----------
    timeout : float
        For all of it [s].
    """
    name = "two processes"
    if util.find_spec("rclpy") is None:
        return [Finding(name, Status.FAULT, "not tried: there is no rclpy", "install ROS 2 first")]
    started = time.monotonic()
    token = uuid.uuid4().hex
    with _pick_environment() as environment:
        talker = _start_probe("talk", token, environment)
        listener = _start_probe("listen", token, environment)
        try:
            output, errors = listener.communicate(timeout=timeout)
        except subprocess.TimeoutExpired:
            return [
                Finding(
                    name,
                    Status.FAULT,
                    f"did not hear each other within {timeout:g} s",
                    "look for a firewall on the loopback interface, a missing `lo`, or variables"
                    " of another middleware (RMW_IMPLEMENTATION, *_PROFILES_FILE, CYCLONEDDS_URI)",
                )
            ]
        finally:
            for process in (listener, talker):
                process.kill()
                process.communicate()
    if listener.returncode != 0 or not output.strip():
        reason = (errors.strip() or "no output").splitlines()[-1]
        return [
            Finding(
                name,
                Status.FAULT,
                f"the listener ended with code {listener.returncode}: {reason}",
                "mend what is marked above first; RMW_IMPLEMENTATION must name an installed one",
            )
        ]
    elapsed = time.monotonic() - started
    return [
        Finding("middleware", Status.OK, output.strip().splitlines()[-1]),
        Finding(name, Status.OK, f"hear each other ({elapsed:.1f} s from start to message)"),
    ]


def _start_probe(
    program: str, token: str, environment: Mapping[str, str]
) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "impact_rig.nodes.probe", program, token],
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@contextlib.contextmanager
def _pick_environment() -> Iterator[dict[str, str]]:
    """Yield the environment of a node, in a domain where nobody else is."""
    environment = dict(os.environ)
    environment.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(ModuleNotFoundError):
            environment["ROS_DOMAIN_ID"] = str(stack.enter_context(reserve_domain()))
        yield environment
