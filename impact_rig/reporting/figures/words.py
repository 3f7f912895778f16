"""Numbers of things and mean square errors, as people read them."""

SMALLEST_PERCENT = 1e-4
"""Mean square error below which no more is said than that [%], our choice: a hundredth of a
thousandth of the paper's smallest bound says nothing more of a model."""


def format_percent(value: float) -> str:
    """Return a percentage of three significant digits, with its sign of percent."""
    if value < SMALLEST_PERCENT:
        return f"< {SMALLEST_PERCENT:.4f} %"
    return f"{value:.3g} %"


def format_count(count: int, thing: str) -> str:
    """Return how many things there are: ``1 hit``, ``10 hits``."""
    return f"{count} {thing}" if count == 1 else f"{count} {thing}s"
