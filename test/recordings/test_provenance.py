"""What a recording says of where it comes from."""

import json
import platform

import numpy as np
import pytest

from impact_rig import __version__
from impact_rig.core.errors import FileError
from impact_rig.recordings import provenance


def test_software_computer_and_notes_are_named():
    fields = provenance.describe_provenance("rmw_x", "bench 3, new tip")
    assert fields["software_version"] == __version__
    assert fields["python"] == platform.python_version()
    assert fields["middleware"] == "rmw_x"
    assert fields["notes"] == "bench 3, new tip"
    assert json.loads(fields["libraries"])["numpy"] == np.__version__
    assert all(isinstance(value, str) for value in fields.values())


@pytest.mark.parametrize(
    ("name", "media_type"),
    [
        ("rig.toml", "application/toml"),
        ("photo.png", "image/png"),
        ("rig", "application/octet-stream"),
    ],
)
def test_an_attached_file_keeps_its_name_kind_and_bytes(tmp_path, name, media_type):
    (tmp_path / name).write_bytes(b"\x00\xffabc")
    attached = provenance.read_attached_file(tmp_path / name)
    assert (attached.name, attached.media_type, attached.data) == (
        name, media_type, b"\x00\xffabc",
    )  # fmt: skip


def test_an_attachment_that_is_absent_or_too_large_is_named(tmp_path, monkeypatch):
    with pytest.raises(FileError, match=r"attachment .*absent\.toml cannot be read"):
        provenance.read_attached_file(tmp_path / "absent.toml")
    monkeypatch.setattr(provenance, "ATTACHMENT_LIMIT", 2)
    (tmp_path / "rig.toml").write_bytes(b"abc")
    with pytest.raises(FileError, match="3 byte: it must not have more than 2"):
        provenance.read_attached_file(tmp_path / "rig.toml")
