"""ROS domains that nobody else uses."""

import contextlib
import subprocess
import sys

import pytest

from impact_rig.nodes.domain import DOMAINS, FIRST_DOMAIN, reserve_domain

HOLDING = """
import sys
from impact_rig.nodes.domain import reserve_domain
with reserve_domain() as number:
    print(number, flush=True)
    sys.stdin.read()
"""


def test_nobody_gets_a_domain_that_is_taken_here_or_by_another_process():
    other = subprocess.Popen(
        [sys.executable, "-c", HOLDING], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    try:
        taken = int(other.stdout.readline())
        with contextlib.ExitStack() as stack:
            ours = {stack.enter_context(reserve_domain()) for _ in range(20)}
        assert len(ours) == 20
        assert taken not in ours
        assert all(FIRST_DOMAIN <= number < FIRST_DOMAIN + DOMAINS for number in ours)
    finally:
        other.communicate()


def test_the_one_that_has_just_become_free_is_rarely_the_next():
    numbers = []
    for _ in range(20):
        with reserve_domain() as number:
            numbers.append(number)
    # All alike by chance: once in a hundred to the nineteenth.
    assert len(set(numbers)) > 1


def test_an_error_in_the_block_stays_what_it_is():
    with pytest.raises(OSError, match="mine"), reserve_domain():
        raise OSError("mine")
    with reserve_domain():
        pass
