"""Rate and missing points of a stream, from the times of its messages."""

import math

import numpy as np

from impact_rig.core.given.errors import DeviceError

LEARNED_POINTS, LEARNED_MESSAGES = 100, 3
"""From so many points and messages the rate is known."""
SHORTEST_TIME, LONGEST_TIME = 1.0, 5.0
"""Where the times are those of the arrival, which varies on a busy computer: so many seconds it
takes at least, and in so many the rate must be the one that is stated."""
STAMP_ERROR = 0.05
"""How far a stamp may lie from an even grid, part of the step from point to point [-], as in
files."""
STAMPED_ERROR, ARRIVAL_ERROR = 1e-3, 0.05
"""How far the rate by stamps or by arrivals may be from the one that is stated, part of it [-]: a
contact time is off by as much."""


class MessageClock:
    """Follows the messages of one topic, in which points come evenly.

    Parameters
    ----------
    rate : float
        As the rig file states it [Hz].
    is_stamped : bool
        The times are stamps, which must be even; else they are those of the arrival.
    """

    def __init__(self, rate: float, *, is_stamped: bool) -> None:
        self._rate, self._is_stamped = rate, is_stamped
        self._begin: int | None = None  # time of the first message [ns]
        # Of each message: time since then [ns], as a float of 1e18 is too coarse; points before.
        self._learned: list[tuple[int, int]] = []
        self._points = 0
        self._step = math.nan  # from point to point, by the times [ns]; NaN: not known yet
        self._due = 0.0  # the next message, since the first [ns]

    @property
    def is_known(self) -> bool:
        """Whether enough has come to know the rate; what came until then is not to be used."""
        return not math.isnan(self._step)

    def take(self, time: int, points: int, lost_messages: int = 0) -> int:
        """Take a message.

        Parameters
        ----------
        time : int
            Of its first point [ns].
        points : int
            That it holds.
        lost_messages : int
            That are missing before it, as far as the middleware tells.

        Returns
        -------
        int
            Points that are missing before it.

        Raises
        ------
        DeviceError
            If the stamps are uneven, or tell another rate than is stated.
        """
        self._begin = time if self._begin is None else self._begin
        time -= self._begin
        if not self.is_known:
            self._learned.append((time, self._points))
            self._points += points
            self._learn()
            self._due = time + points * self._step
            return 0
        lost = lost_messages * points
        if self._is_stamped:
            late = (time - self._due) / self._step
            lost = round(late)
            # Two stamps may be off, and the step is not known better than the rate.
            if lost < 0 or abs(late - lost) > 2.0 * STAMP_ERROR + STAMPED_ERROR * lost:
                raise self._refuse(f"one is {late * self._step * 1e-3:.4g} µs late")
        self._due = time + points * self._step
        return lost

    def _learn(self) -> None:
        """Find the step, once enough has come."""
        end, points = self._learned[-1]
        is_long = self._is_stamped or end >= SHORTEST_TIME * 1e9
        if points < LEARNED_POINTS or len(self._learned) < LEARNED_MESSAGES or not is_long:
            return
        times, places = np.array(self._learned, dtype=np.float64).T
        step = end / points
        error = np.abs(times - step * places).max()
        if self._is_stamped and not error <= STAMP_ERROR * step:
            raise self._refuse(f"they are up to {error * 1e-3:.4g} µs from an even grid")
        rate = 1e9 / step if step > 0.0 else math.inf
        limit = STAMPED_ERROR if self._is_stamped else ARRIVAL_ERROR
        if abs(rate / self._rate - 1.0) > limit:
            if not self._is_stamped and end < LONGEST_TIME * 1e9:
                return
            what = "stamps" if self._is_stamped else "arrivals"
            raise DeviceError(
                f"its points come at {rate:.5g} Hz, by the {what} of the messages, and"
                f" sampling_rate is {self._rate:.5g} Hz: state the right one"
            )
        self._step = step

    def _refuse(self, how: str) -> DeviceError:
        return DeviceError(
            f"the stamps of its messages are uneven: {how}, and points come every"
            f" {1e6 / self._rate:.4g} µs. If the points are even, write ignore_stamps = true: then"
            " sampling_rate alone counts"
        )
