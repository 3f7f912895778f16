"""How fast something goes on."""

import time


class RateMeter:
    """Turns counts into rates, from one call to the next."""

    def __init__(self) -> None:
        self._counts: dict[str, int] = {}
        self._time = time.monotonic()

    def measure(self, counts: dict[str, int]) -> dict[str, float]:
        """Return how much was counted per second since the last call [1/s], by name."""
        now = time.monotonic()
        elapsed, self._time = now - self._time, now
        previous, self._counts = self._counts, dict(counts)
        if elapsed <= 0.0:
            return dict.fromkeys(counts, 0.0)
        return {name: (n - previous.get(name, 0)) / elapsed for name, n in counts.items()}
