"""A running recording of a sound card."""

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from impact_rig.core.errors import DeviceError, ParameterError
from impact_rig.devices.sound.port_audio import (
    NO_SUCH_CHANNELS,
    NO_SUCH_RATE,
    SoundInput,
    close_stream,
    load_port_audio,
    open_stream,
    tell,
)
from impact_rig.devices.streaming.capture import StreamCapture


class SoundCapture(StreamCapture):
    """Records from the moment it is made until it is closed.

    Points that PortAudio reports as lost are a gap, whose length it does not tell: it is estimated
    from the time of the blocks.

    Parameters
    ----------
    device : SoundInput
        Of which to record.
    sampling_rate : float
        [Hz]
    columns : sequence of int
        The device's channels to keep, counted from 0, in this order.
    capacity : int
        Points to keep at least.

    Raises
    ------
    ParameterError
        If the device does not know the rate.
    DeviceError
        If it is in other hands, or gone.
    """

    def __init__(
        self, device: SoundInput, sampling_rate: float, columns: Sequence[int], capacity: int
    ) -> None:
        super().__init__(f"sound device {device.full_name}", sampling_rate, capacity)
        self._device = device
        self._columns = list(columns)
        self._last_block: tuple[float, int] | None = None
        self._clock_offset = 0.0
        self._stream = self._open()
        self.sampling_rate = float(self._stream.samplerate)
        # PortAudio's clock may begin anywhere.
        self._clock_offset = time.time() - self._stream.time

    def close(self) -> None:
        """Stop recording; never raises."""
        close_stream(self._stream)

    def _open(self) -> Any:
        sound = load_port_audio()
        try:
            return open_stream(
                device=self._device.number,
                samplerate=self.sampling_rate,
                channels=max(self._columns) + 1,
                dtype="int32",
                callback=self._take_block,
                finished_callback=lambda: self.end("it has stopped"),
            )
        except sound.PortAudioError as error:
            code = error.args[1] if len(error.args) > 1 else 0
            if code in (NO_SUCH_RATE, NO_SUCH_CHANNELS):
                raise ParameterError(
                    f"{self.name} cannot record {max(self._columns) + 1} channels at"
                    f" {self.sampling_rate:g} Hz: {tell(error)}; it prefers"
                    f" {self._device.sampling_rate:g} Hz"
                ) from None
            raise DeviceError(
                f"{self.name} cannot be opened, because it is gone or another program has it:"
                f" {tell(error)}"
            ) from None

    def _take_block(self, data: Any, frames: int, times: Any, status: Any) -> None:
        """Take what has come; called by PortAudio's own thread."""
        counts = np.frombuffer(data, np.int32).reshape(frames, -1)[:, self._columns]
        taken = float(times.inputBufferAdcTime)
        lost = self._estimate_loss(taken) if status.input_overflow else 0
        # Some interfaces do not tell the time.
        since_epoch = taken + self._clock_offset if taken else time.time()
        self._last_block = (taken, frames)
        self.take(counts, round(since_epoch * 1e9), lost)

    def _estimate_loss(self, taken: float) -> int:
        """Return about how many points were lost before a block: PortAudio does not tell."""
        if not (taken and self._last_block):
            return 1
        before, frames = self._last_block
        return max(round((taken - before) * self.sampling_rate) - frames, 1)
