"""A file takes all pieces it is given, or none of them."""

import os

import pytest

from impact_rig.core.errors import FileError
from impact_rig.recording.writing.disk_file import MOST_PIECES, DiskFile

PIECES = tuple(number.to_bytes(2, "little") for number in range(3 * MOST_PIECES + 1))


def test_more_pieces_are_written_than_the_system_takes_at_once(tmp_path):
    file = DiskFile(tmp_path / "new")
    file.write(*PIECES)
    file.close()
    assert (tmp_path / "new").read_bytes() == b"".join(PIECES)
    assert file.size == 2 * len(PIECES)


def test_the_rest_of_a_write_that_was_cut_short_follows(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "writev", lambda file, pieces: os.write(file, b"".join(pieces)[:99]))
    file = DiskFile(tmp_path / "new")
    file.write(*PIECES)
    file.close()
    assert (tmp_path / "new").read_bytes() == b"".join(PIECES)


def test_pieces_that_were_written_go_again_if_a_later_one_cannot_be(tmp_path, monkeypatch):
    file = DiskFile(tmp_path / "new")
    file.write(b"before")
    monkeypatch.setattr(os, "writev", fail_from_second_call(os.writev))
    with pytest.raises(FileError, match="new cannot be written: Input/output error; it keeps"):
        file.write(*PIECES)
    with pytest.raises(FileError, match="Input/output error"):
        file.write(b"after")
    file.close()
    assert (tmp_path / "new").read_bytes() == b"before"
    assert file.size == len(b"before")


def fail_from_second_call(write):
    calls = []

    def call(file, pieces):
        calls.append(pieces)
        if len(calls) > 1:
            raise OSError(5, os.strerror(5))
        return write(file, pieces)

    return call
