"""What the environment must say for the nodes of several computers to find and hear each other."""

from collections.abc import Mapping

DISCOVERY = "ROS_AUTOMATIC_DISCOVERY_RANGE"
TRANSPORTS = "FASTDDS_BUILTIN_TRANSPORTS"
PROFILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
HERE = ("LOCALHOST", "OFF")
SOCKET_BUFFER = 4_000_000
"""Of sockets between computers [bytes], our choice: 200 ms of both channels at 2.5 MS/s. A block
of 10 ms comes at once, and fills the 0.2 MB that Linux gives by itself."""


def find_network_variables(environment: Mapping[str, str], *, network: bool) -> dict[str, str]:
    """Return the environment variables that a rig adds to those which are set.

    Parameters
    ----------
    environment : mapping of str to str
        That goes first.
    network : bool
        Whether nodes on other computers are looked for.

    Returns
    -------
    dict of str to str
        How far ROS looks; and, where it looks beyond this computer and nobody has chosen its
        transports, sockets that hold a block of a running stream. Linux grants them up to
        `net.core.rmem_max`.
    """
    variables = {}
    if DISCOVERY not in environment:
        variables[DISCOVERY] = "SUBNET" if network else "LOCALHOST"
    is_far = {**environment, **variables}[DISCOVERY] not in HERE
    if is_far and not any(name in environment for name in (TRANSPORTS, *PROFILES)):
        variables[TRANSPORTS] = f"DEFAULT?sockets_size={SOCKET_BUFFER}B"
    return variables
