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

    Between any two stamps the points may take longer or shorter than is stated by a thousandth of
    that time and a tenth of a step. Arrivals are late on a busy computer, never early: the least
    late message of each second tells the rate.

    Parameters
    ----------
    rate : float
        As the rig file states it [Hz].
    is_stamped : bool
        The times are stamps, which must be even; else they are those of the arrival.
    """

    def __init__(self, rate: float, *, is_stamped: bool) -> None:
        self._rate, self._is_stamped = rate, is_stamped
        # From point to point, as stated and as the first messages came [ns].
        self._step = self._learned_step = 1e9 / rate
        self._begin: int | None = None  # time of the first message [ns]
        # Of each message: time since then [ns], as a float of 1e18 is too coarse; points before.
        self._learned: list[tuple[int, int]] = []
        self.is_known = False  # enough has come to know the rate; what came before is not used
        self._points = 0
        self._due = 0.0  # the next message, since the first [ns]
        # Lateness of stamps less and more the rate error that is allowed: its least and its
        # largest, each with its message's time and points [ns, ns, points].
        self._low = self._high = (0.0, 0, 0)
        # Of arrivals: where this second began, and the least lateness in it and the one before.
        self._second = 0
        self._least, self._least_before = math.inf, math.nan

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
            If the stamps are uneven, or the times tell another rate than is stated.
        """
        self._begin = time if self._begin is None else self._begin
        time -= self._begin
        lost = 0
        if not self.is_known:
            self._learned.append((time, self._points))
            self._learn()
        elif self._is_stamped:
            lost = self._count_lost(time)
        else:
            lost = lost_messages * points
        self._points += lost
        if self.is_known:
            late = time - self._step * self._points
            (self._check_stamp if self._is_stamped else self._check_arrival)(time, late)
        self._points += points
        self._due = time + points * self._learned_step
        return lost

    def _learn(self) -> None:
        """Compare the measured rate with the stated one, once there are enough points."""
        end, points = self._learned[-1]
        is_long = self._is_stamped or end >= SHORTEST_TIME * 1e9
        if points < LEARNED_POINTS or len(self._learned) < LEARNED_MESSAGES or not is_long:
            return
        times, places = np.array(self._learned, dtype=np.float64).T
        step = end / points
        error = np.abs(times - step * places).max()
        if self._is_stamped and not error <= STAMP_ERROR * step:
            raise self._refuse(f"they are up to {error * 1e-3:.4g} µs from an even grid")
        limit = STAMPED_ERROR if self._is_stamped else ARRIVAL_ERROR
        if abs(self._step / step - 1.0 if step > 0.0 else math.inf) > limit:
            if not self._is_stamped and end < LONGEST_TIME * 1e9:
                return
            raise self._refuse_rate(end, points)
        self.is_known, self._learned_step = True, step
        self._second, self._least_before = end, float((times - self._step * places).min())
        late = end - self._step * points
        slack = STAMPED_ERROR * self._step * points
        self._low, self._high = (late - slack, end, points), (late + slack, end, points)

    def _count_lost(self, time: int) -> int:
        """Return how many points are missing before a message of this stamp."""
        late = (time - self._due) / self._learned_step
        lost = round(late)
        if lost < 0:
            raise self._refuse(f"one is {-late * self._step * 1e-9:.4g} s before it is due")
        if abs(late - lost) > 2.0 * STAMP_ERROR + STAMPED_ERROR * lost:
            raise self._refuse(f"one is {late * self._step * 1e-3:.4g} µs late")
        return lost

    def _check_stamp(self, time: int, late: float) -> None:
        """Hold the points since any message before against their time."""
        slack = STAMPED_ERROR * self._step * self._points
        room = 2.0 * STAMP_ERROR * self._step
        low, high = late - slack, late + slack
        for is_off, since in (
            (low > self._low[0] + room, self._low),
            (high < self._high[0] - room, self._high),
        ):
            if is_off:
                raise self._refuse_rate(time - since[1], self._points - since[2])
        self._low = min(self._low, (low, time, self._points))
        self._high = max(self._high, (high, time, self._points))

    def _check_arrival(self, time: int, late: float) -> None:
        """Hold the least lateness in each second against that in the second before."""
        elapsed = time - self._second
        if elapsed >= SHORTEST_TIME * 1e9:
            change = self._least - self._least_before
            if abs(change) > ARRIVAL_ERROR * elapsed:
                how = "fell behind" if change > 0.0 else "came early"
                raise DeviceError(
                    f"in {elapsed * 1e-9:.2g} s its points {how} by {abs(change) * 1e-9:.2g} s, by"
                    f" the arrivals of its messages, and sampling_rate is {self._rate:.5g} Hz:"
                    " state the right one"
                )
            self._least_before, self._least = self._least, math.inf
            self._second = time
        self._least = min(self._least, late)

    def _refuse_rate(self, time: float, points: int) -> DeviceError:
        rate = points / time * 1e9 if time > 0.0 else math.inf
        what = "stamps" if self._is_stamped else "arrivals"
        return DeviceError(
            f"its points come at {rate:.5g} Hz, by the {what} of the messages, and"
            f" sampling_rate is {self._rate:.5g} Hz: state the right one"
        )

    def _refuse(self, how: str) -> DeviceError:
        return DeviceError(
            f"the stamps of its messages are uneven: {how}, and points come every"
            f" {1e6 / self._rate:.4g} µs. If the points are even, write ignore_stamps = true: then"
            " sampling_rate alone counts"
        )
