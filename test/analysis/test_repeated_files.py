"""Files named twice are found, under whatever name."""

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


@pytest.mark.parametrize("link", [Path.symlink_to, Path.hardlink_to])
def test_a_link_is_the_file_that_it_leads_to(first, link):
    other = first.with_name("other.mcap")
    link(other, first)
    (sentence,) = find_repeated_files([first, other]).values()
    assert sentence == f"{other} and {first} are the same: it is used once"


def test_a_copy_is_found_by_its_bytes(first):
    between = first.with_name("between.mcap")
    between.write_bytes(b"something else in between")
    copy = first.with_name("copy.mcap")
    copy.write_bytes(first.read_bytes())
    (found,) = find_repeated_files([first, between, copy]).items()
    assert found == (2, f"{copy} is left out: it is a copy of {first}, byte by byte")


def test_what_cannot_be_read_or_is_empty_is_left_to_its_reader(tmp_path):
    missing, empty, also_empty = (tmp_path / name for name in ("a.mcap", "b.mcap", "c.mcap"))
    empty.touch()
    also_empty.touch()
    assert find_repeated_files([missing, missing, empty, also_empty]) == {}
