"""A ROS domain that nobody else on this host uses."""

import itertools
import random
from collections.abc import Iterator
from contextlib import contextmanager

FIRST_DOMAIN = 1
"""0 is that of whoever names none."""
DOMAINS = 100
"""How many are handed out [-]: ports of higher ones reach into those of outgoing connections."""


@contextmanager
def reserve_domain() -> Iterator[int]:
    """Reserve a ROS domain for the length of the block, and yield its number.

    The search begins at random: one that has just become free may still be left by the last
    messages of whoever used it.

    Raises
    ------
    RuntimeError
        If all are taken.
    """
    from domain_coordinator import domain_id

    candidates = itertools.count(random.SystemRandom().randrange(DOMAINS))
    reservation = domain_id(lambda: FIRST_DOMAIN + next(candidates) % DOMAINS)
    number = reservation.__enter__()
    try:
        yield number
    finally:
        # Not told of an error in the block, which it would take for a domain that is in use.
        reservation.__exit__(None, None, None)
