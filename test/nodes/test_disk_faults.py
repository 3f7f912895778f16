"""The recorder's disk stands still or is gone in a campaign: a real file system."""

import contextlib
import fcntl
import os
import shutil
import struct
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from action_msgs.msg import GoalStatus
from impact_rig_msgs.action import RunCampaign
from impact_rig_msgs.srv import GetResults
from rclpy.parameter import Parameter

from impact_rig.nodes import interfaces
from impact_rig.nodes.campaign import CampaignNode

from .campaigns import begin, make_client
from .test_kill import find_whole_records

FIFREEZE, FITHAW, EXT4_IOC_SHUTDOWN = 0xC0045877, 0xC0045878, 0x8004587D
"""Requests of `ioctl`, from Linux's headers."""
WITHOUT_FLUSH = struct.pack("I", 2)
PAUSED = RunCampaign.Feedback.PAUSED


class Disk:
    """An ext4 file system in a file, mounted by a loop device, with faults of Linux's own."""

    def __init__(self, image: Path, folder: Path) -> None:
        self.folder = folder
        self._image = image
        with image.open("wb") as file:
            file.truncate(128 << 20)
        _run("mkfs.ext4", "-q", "-F", str(image))
        folder.mkdir()
        self._mount()

    def read_elsewhere(self) -> None:
        """Mount what has reached the disk anew, as another computer that it is plugged into.

        A copy, as Linux keeps a disk that was taken away as it is while anybody uses it, and a
        process that has a view of the mounts of its own does, whoever unmounts it here.
        """
        self.drop()
        self._image = Path(shutil.copy(self._image, self._image.with_suffix(".copy")))
        self._mount()

    def _mount(self) -> None:
        _run("mount", "-o", "loop", str(self._image), str(self.folder))

    def drop(self) -> None:
        with contextlib.suppress(OSError):
            self.thaw()
        _run("umount", "--lazy", str(self.folder))

    def freeze(self) -> None:
        """Let every write wait until it thaws."""
        self._control(FIFREEZE)

    def thaw(self) -> None:
        self._control(FITHAW)

    def take_away(self) -> None:
        """Let every access fail from now on, as that to a drive that was pulled."""
        self._control(EXT4_IOC_SHUTDOWN, WITHOUT_FLUSH)

    def _control(self, request: int, argument: int | bytes = 0) -> None:
        root = os.open(self.folder, os.O_RDONLY)
        try:
            fcntl.ioctl(root, request, argument)
        finally:
            os.close(root)


def _run(*words: str) -> str:
    return subprocess.run(words, check=True, capture_output=True, text=True).stdout.strip()


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Disk]:
    try:
        disk = Disk(tmp_path / "image", tmp_path / "disk")
    except (OSError, subprocess.CalledProcessError) as error:
        pytest.skip(f"this process may not mount a disk: {error}")
    yield disk
    disk.drop()


def test_a_disk_that_stands_still_is_waited_for_and_one_that_is_gone_ends_the_campaign(
    harness, start_process, disk
):
    processes = [
        start_process("recorder", output=str(disk.folder / "session.mcap")),
        start_process("hammer", swing_time=0.001),
        start_process("accelerometer", required_subscribers="estimator"),
        start_process("estimator"),
    ]
    node = harness.add(CampaignNode)
    harness.call(GetResults, interfaces.GET_RESULTS)
    goal = {"samples": ["steel small"], "impacts": 100_000}
    handle, feedback = begin(harness, make_client(harness), **goal)
    feedback.wait(lambda got: got[-1:] and got[-1].impact >= 1)

    node.set_parameters([Parameter("verdict_timeout", value=1.0)])
    disk.freeze()
    feedback.wait(lambda got: got[-1].state == PAUSED)
    assert "recorder" in feedback.messages[-1].message
    node.set_parameters([Parameter("verdict_timeout", value=10.0)])
    disk.thaw()
    before = feedback.messages[-1].impact
    feedback.wait(lambda got: got[-1].impact > before)

    node.set_parameters([Parameter("pause_timeout", value=1.0)])
    disk.take_away()
    answer = harness.wait(handle.get_result_async())
    assert answer.status == GoalStatus.STATUS_ABORTED
    path = Path(answer.result.recording)
    # Which of both is seen first depends on how long the disk takes to say so.
    reasons = f"{path} cannot be written: Input/output error", "recorder/join did not answer"
    assert any(reason in answer.result.message for reason in reasons)
    for process in processes:
        process.kill()
    disk.read_elsewhere()
    accepted = answer.result.accepted
    assert [hit.impact for hit in accepted] == list(range(1, len(accepted) + 1))
    assert {hit.record for hit in accepted} <= find_whole_records(path)
