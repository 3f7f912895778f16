"""Whether the rest of the rig could record a hit now, by what the hammer node has heard of it."""

from collections.abc import Callable
from typing import Any

from impact_rig_msgs.msg import AcquisitionState, RecorderState
from impact_rig_msgs.srv import Release

from impact_rig.nodes import interfaces
from impact_rig.nodes.peer import GONE, Peer
from impact_rig.nodes.rig_node import RigNode
from impact_rig.nodes.unhurried import UnhurriedTopic


class RigReadiness:
    """Listens to accelerometers and recorder.

    Parameters
    ----------
    node : RigNode
        The hammer's; its parameter `require_recorder` is read.
    take_acquisition : callable
        Called with what the accelerometers say.
    note_change : callable
        Called when one of them has fallen silent, come back or left.
    """

    def __init__(
        self,
        node: RigNode,
        take_acquisition: Callable[[AcquisitionState], None],
        note_change: Callable[[], None],
    ) -> None:
        self._acquisition: AcquisitionState | None = None
        self._node: Any = node
        self._recorder: RecorderState | None = None
        self._was_recording = False
        self._unstored = 0
        self._recorder_node = Peer(
            node, interfaces.RECORDER_STATE, self._take_recorder, note_change
        )
        self._stored = UnhurriedTopic(node, interfaces.RECORD_STORED)
        self._accelerometer_node = Peer(
            node, interfaces.ACQUISITION_STATE, take_acquisition, note_change
        )

    @property
    def recording(self) -> str:
        """Where a hit would be recorded now; empty: nowhere."""
        recorder = self._recorder
        return recorder.uri if recorder is not None and recorder.recording else ""

    def take_acquisition(self, message: AcquisitionState) -> None:
        """Hear the accelerometers."""
        self._acquisition = message

    def note_release(self, record: int) -> None:
        """Note that a hit is on its way into the recording, if there is one.

        What was said before `find_obstacle` was asked for the last time is said of earlier hits;
        what has come since may be said of this one, if the swing takes no time.
        """
        if self.recording:
            self._unstored = record

    def find_loss(self) -> str:
        """Return what was there and is lost; empty: nothing.

        What has not been heard of yet, or has come to a normal end, is not lost.
        """
        acquisition = self._acquisition
        if acquisition is not None:
            if acquisition.state == AcquisitionState.FAULT:
                return f"the accelerometers are lost: {acquisition.message}"
            if self._accelerometer_node.is_lost:
                return f"the accelerometer node {GONE}"
        recorder = self._recorder
        if recorder is None or not self._node.get_value("require_recorder"):
            return ""
        if self._recorder_node.is_lost:
            return f"the recorder {GONE}"
        if self._was_recording and not (recorder.recording or recorder.waiting):
            return f"nothing is being recorded any more ({recorder.message})"
        return ""

    def is_settled(self, request: Release.Request) -> bool:
        """Whether nodes that are just starting have found each other, and the disk is quiet."""
        if self._acquisition is None:
            return False
        if not self._node.get_value("require_recorder"):
            return True
        recorder = self._recorder
        return recorder is not None and not recorder.waiting and not self._is_unstored(request)

    def find_obstacle(self, request: Release.Request) -> str:
        """Return why the rest of the rig could not record a hit; empty: it could."""
        return (
            self.find_loss()
            or self._find_acquisition_obstacle(request)
            or self._find_recorder_obstacle(request)
        )

    def _find_acquisition_obstacle(self, request: Release.Request) -> str:
        acquisition = self._acquisition
        if acquisition is None or acquisition.state != AcquisitionState.ARMED:
            return "the accelerometers are not armed: call accelerometer/arm first"
        if (acquisition.record, acquisition.sample) != (request.record, request.sample):
            return (
                f"the accelerometers are armed for record {acquisition.record} on"
                f" {acquisition.sample!r}, not for record {request.record} on"
                f" {request.sample!r}"
            )
        return ""

    def _find_recorder_obstacle(self, request: Release.Request) -> str:
        if not self._node.get_value("require_recorder"):
            return ""
        if not self.recording:
            why = self._recorder.message if self._recorder else "no recorder has reported"
            return f"nothing is being recorded ({why}): start the recorder first"
        if self._is_unstored(request):
            return (
                f"the recorder has not said that record {self._unstored} is stored: wait for it,"
                " or start the recorder anew"
            )
        return ""

    def _is_unstored(self, request: Release.Request) -> bool:
        """Whether the record before this one is still on its way to the disk."""
        self._take_stored()
        return self._unstored not in (0, request.record)

    def _take_recorder(self, message: RecorderState) -> None:
        previous, self._recorder = self._recorder, message
        self._was_recording = self._was_recording or message.recording
        if not message.recording or (previous and previous.uri != message.uri):
            # What one recording did not store, the next one will not.
            self._unstored = 0

    def _take_stored(self) -> None:
        for message in self._stored.take():
            if message.complete and message.record == self._unstored:
                self._unstored = 0
