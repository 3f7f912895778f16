"""Blocks that come and go take no new memory of the system."""

import platform
import subprocess
import sys

import pytest

BLOCKS = 100
PAGES = 1_600_000 // 4096
SCRIPT = f"""
import resource
from impact_rig.nodes.kept_memory import keep_memory
if {{}}:
    keep_memory()
def count_new_pages():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range({BLOCKS}):
        block = bytes(b"x" * {PAGES * 4096})
        copy = bytearray(block)
        del block, copy
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before
count_new_pages()
print(count_new_pages())
"""


def count_new_pages(*, is_kept: bool) -> int:
    """Return how many pages the system gave a process for its blocks, once it is under way."""
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT.format(is_kept)],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    return int(done.stdout)


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another C library")
def test_a_block_gets_the_memory_of_the_one_before():
    assert count_new_pages(is_kept=False) > BLOCKS * PAGES
    assert count_new_pages(is_kept=True) < PAGES
