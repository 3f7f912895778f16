"""Mean square errors as people read them."""

SMALLEST_PERCENT = 1e-4
"""Mean square error below which no more is said than that [%], our choice: a hundredth of a
thousandth of the paper's smallest bound says nothing more of a model."""


def format_percent(value: float) -> str:
    """Return a percentage of three significant digits, with its sign of percent."""
    if value < SMALLEST_PERCENT:
        return f"< {SMALLEST_PERCENT:.4f} %"
    return f"{value:.3g} %"
