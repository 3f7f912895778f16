"""Which points of a uniform time grid lie in the contact."""

import math
from typing import NamedTuple


class ContactSpan(NamedTuple):
    """The points in the contact.

    Attributes
    ----------
    first, free : int
        The first point in the contact, and the first one beyond it; the number of points, if
        there is none.
    begin : float
        Time of `first`, counted from the start of the contact [s].
    late : float
        Time of `free`, counted from the end of the contact [s].
    """

    first: int
    free: int
    begin: float
    late: float


def find_contact(
    start: float, contact_time: float, sampling_rate: float, count: int
) -> ContactSpan:
    """Find the points with 0 <= t <= tau_p.

    Parameters
    ----------
    start : float
        Time of the first point, counted from the start of the contact [s].
    contact_time : float
        tau_p [s].
    sampling_rate : float
        [Hz]
    count : int
        Number of points.
    """
    first = _find_point(start, 0.0, sampling_rate, count)
    beyond = math.nextafter(contact_time, math.inf)
    free = _find_point(start, beyond, sampling_rate, count)
    begin, late = start + first / sampling_rate, start + free / sampling_rate - contact_time
    # Where the grid has no such point, a harmless time.
    return ContactSpan(first, free, min(max(begin, 0.0), contact_time), max(late, 0.0))


def _find_point(start: float, time: float, sampling_rate: float, count: int) -> int:
    """Return the first point at a time or after it; `count`: there is none."""
    place = (time - start) * sampling_rate
    if not -1.0 < place < count + 1.0:
        return 0 if place < 0.0 else count
    point = math.ceil(place)
    # The grid is start + n / rate as rounded, which may be one point aside.
    if start + (point - 1) / sampling_rate >= time:
        point -= 1
    elif start + point / sampling_rate < time:
        point += 1
    return min(max(point, 0), count)
