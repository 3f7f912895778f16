"""A file appears complete or not at all, and never takes the place of another."""

import errno
import io
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from impact_rig.core.given.errors import FileError
from impact_rig.recordings.new_file import DiskFile, write_new_file

CONTENT = bytes(range(256)) * 40


class Reluctant:
    """A file that takes a few bytes at once, and after some calls none."""

    def __init__(self, file, calls=1 << 30):
        self._file = file
        self._left = calls

    def __getattr__(self, name):
        return getattr(self._file, name)

    def write(self, data):
        self._left -= 1
        if self._left < 0:
            raise OSError(5, os.strerror(5))
        return self._file.write(data[:99])


def test_the_rest_of_a_write_that_was_cut_short_follows(tmp_path):
    file = DiskFile(tmp_path / "new")
    file._file = Reluctant(file._file)
    assert file.write(CONTENT) == len(CONTENT)
    file.close()
    assert (tmp_path / "new").read_bytes() == CONTENT
    assert file.tell() == file.size == len(CONTENT)


def test_what_was_written_goes_again_if_the_rest_cannot_be(tmp_path):
    file = DiskFile(tmp_path / "new")
    file.write(b"before")
    file._file = Reluctant(file._file, 3)
    with pytest.raises(FileError, match="new cannot be written: Input/output error; it keeps"):
        file.write(CONTENT)
    with pytest.raises(FileError, match="Input/output error"):
        file.write(b"after")
    file.close()
    assert (tmp_path / "new").read_bytes() == b"before"
    assert file.size == len(b"before")


@pytest.mark.parametrize(
    ("meddle", "told"),
    [
        (Path.unlink, "was deleted while it was written"),
        (lambda path: path.rename(path.with_name("elsewhere")), "was deleted"),
        (lambda path: (path.unlink(), path.touch()), "was replaced while it was written"),
        (lambda path: os.truncate(path, 3), "was cut to 3 byte while .*: there were 6"),
    ],
)
def test_what_is_no_longer_under_its_name_does_not_count_as_written(tmp_path, meddle, told):
    file = DiskFile(tmp_path / "new")
    file.write(b"before")
    file.sync()
    meddle(tmp_path / "new")
    with pytest.raises(FileError, match=told):
        file.sync()
    with pytest.raises(FileError, match=told):
        file.close()


class LostDrive(io.FileIO):
    """A file on a network drive that says only when it is closed what it has not written."""

    def close(self) -> None:
        was_open = not self.closed
        super().close()
        if was_open:
            raise OSError(errno.EIO, os.strerror(errno.EIO))


def test_what_a_drive_says_only_when_the_file_is_closed_is_told(tmp_path):
    file = DiskFile(tmp_path / "new")
    file._file.close()
    file._file = LostDrive(file.path, "ab")
    with pytest.raises(FileError, match="new cannot be written: Input/output error"):
        file.close()
    assert file.closed


@pytest.fixture
def folder(tmp_path) -> Path:
    """Return an empty folder."""
    path = tmp_path / "files"
    path.mkdir()
    return path


def write(path: Path, during: Callable[[], object] = lambda: None) -> None:
    """Write a file; something happens meanwhile."""
    with write_new_file(path) as part:
        part.write_text("late")
        during()


def fail(error: BaseException) -> None:
    raise error


def list_names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("is_link", [False, True], ids=["a file", "a link to nowhere"])
def test_what_was_there_before_stays(tmp_path, is_link):
    path = tmp_path / "old.csv"
    path.symlink_to(tmp_path / "lost.csv") if is_link else path.write_text("old")
    with pytest.raises(FileError, match=r"old\.csv exists already"), write_new_file(path):
        pytest.fail("nothing may be written")
    assert is_link or path.read_text() == "old"


def refuse_links(_: Path, __: Path) -> None:
    raise OSError(errno.EPERM, os.strerror(errno.EPERM))


@pytest.mark.parametrize("has_links", [True, False])
def test_the_file_appears_when_the_block_ends_unless_another_came_meanwhile(
    folder, monkeypatch, has_links
):
    if not has_links:  # as on some file systems
        monkeypatch.setattr(Path, "hardlink_to", refuse_links)
    path = folder / "deep" / "new.csv"
    write(path, lambda: fail(AssertionError()) if path.exists() else None)
    assert path.read_text() == "late"
    assert list_names(path.parent) == ["new.csv"]
    path.rename(folder / "old.csv")
    path = folder / "new.csv"
    with pytest.raises(FileError, match=r"new\.csv exists already"):
        write(path, partial(path.write_text, "first"))
    assert path.read_text() == "first"
    assert list_names(folder) == ["deep", "new.csv", "old.csv"]


@pytest.mark.parametrize(
    ("error", "raised", "told"),
    [
        (KeyError("x"), KeyError, "x"),
        (OSError(errno.ENOSPC, "No space"), FileError, r"new\.csv cannot be written: No space"),
    ],
)
def test_a_block_that_fails_leaves_nothing(folder, error, raised, told):
    with pytest.raises(raised, match=told):
        write(folder / "new.csv", partial(fail, error))
    assert list_names(folder) == []


@pytest.mark.parametrize("name", ["file/new.csv", "file/deep/new.csv"])
def test_a_file_in_the_way_of_the_folder_is_named(tmp_path, name):
    (tmp_path / "file").write_text("")
    with (
        pytest.raises(FileError, match=r"folder .*file.* cannot be made: a file is in its way"),
        write_new_file(tmp_path / name),
    ):
        pytest.fail("nothing may be written")
