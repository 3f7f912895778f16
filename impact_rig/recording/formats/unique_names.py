"""Names as a format allows them, each once."""

from collections.abc import Callable, Sequence


def make_unique(
    names: Sequence[str], clean: Callable[[str], str], number_format: str = " ({})"
) -> list[str]:
    """Return a name for each channel that a format can hold.

    Parameters
    ----------
    names : sequence of str
        Of the channels; a name may be there twice.
    clean : callable
        Returns a name that the format allows, the same if it is one.
    number_format : str
        What is added to a name that is taken, a number in place of the braces.

    Returns
    -------
    list of str
        As many, all different, also if the case of letters does not count.
    """
    taken: set[str] = set()
    unique = []
    for name in names:
        candidate = allowed = clean(name)
        number = 2
        while candidate.lower() in taken:
            candidate = allowed + number_format.format(number)
            number += 1
        taken.add(candidate.lower())
        unique.append(candidate)
    return unique
