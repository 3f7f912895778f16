"""Files named twice are found, under whatever name."""

import shutil
from pathlib import Path

import pytest

from impact_rig.analysis.repeated_files import find_repeated_files


@pytest.fixture
def first(tmp_path: Path) -> Path:
    """Return a file."""
    path = tmp_path / "first.mcap"
    path.write_bytes(b"a recording")
    return path


def test_different_files_of_one_size_are_different(first):
    second = first.with_name("second.mcap")
    second.write_bytes(b"another one")
    assert find_repeated_files([first, second]) == {}


def test_a_path_given_twice_is_found(first):
    assert find_repeated_files([first, first]) == {1: f"{first} is named twice: it is used once"}


@pytest.mark.parametrize("make", [Path.symlink_to, shutil.copy2])
def test_a_link_and_a_copy_are_found_by_their_bytes(first, make):
    between, other = first.with_name("between.mcap"), first.with_name("other.mcap")
    between.write_bytes(b"something else in between")
    make(other, first) if make is Path.symlink_to else make(first, other)
    (found,) = find_repeated_files([first, between, other]).items()
    assert found == (2, f"{other} is left out: it is a copy of {first}, byte by byte")


def test_what_cannot_be_read_or_is_empty_is_left_to_its_reader(tmp_path):
    missing, empty, also_empty = (tmp_path / name for name in ("a.mcap", "b.mcap", "c.mcap"))
    empty.touch()
    also_empty.touch()
    assert find_repeated_files([missing, missing, empty, also_empty]) == {}
