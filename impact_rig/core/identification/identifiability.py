"""Which combinations of parameters the traces do not determine, by name."""

from collections.abc import Sequence

import numpy as np

from impact_rig.core.errors import NotDeterminedError
from impact_rig.core.signals.record import FloatArray

LARGEST_RELATIVE_UNCERTAINTY = 0.5
"""Standard uncertainty over the value above which a parameter counts as not determined [-], our
choice: beyond it the 95 % interval reaches zero."""
MEMBER_PART = 0.3
"""Least part in a combination, over the largest part, that makes a parameter a member [-], our
choice."""
SMALLEST_SINGULAR_VALUE = 1e-6
"""Singular value over the largest, of derivatives scaled to unit length, below which they count
as dependent [-], our choice: the derivatives are good to some 1e-7."""

LARGEST_RESIDUAL = 0.05
"""RMS residual over the peak above which the model does not describe a trace [-], our choice: over
a record of ten contacts it means some 15 % during the contact."""
GOOD_CHI_SQUARE = 2.0
"""Reduced chi-square below which a residual counts as noise [-], our choice: noise alone does not
reach it."""
TRACES = ("hammer", "sample")


def check_independence(names: Sequence[str], derivatives: FloatArray) -> None:
    """Require that no parameter can be replaced by others.

    Parameters
    ----------
    derivatives : ndarray, shape (n, p)
        Of all points in all parameters, weighted.

    Raises
    ------
    NotDeterminedError
        If a parameter moves nothing, or the derivatives are linearly dependent.
    """
    lengths = np.linalg.norm(derivatives, axis=0)
    if not np.all(np.isfinite(lengths)):
        raise NotDeterminedError("identification: the model's derivatives are no finite numbers")
    for name, length in zip(names, lengths, strict=True):
        if length == 0.0:
            raise NotDeterminedError(
                f"{name}: not determined, since the traces do not depend on it"
            )
    _, singular, directions = np.linalg.svd(derivatives / lengths, full_matrices=False)
    if singular[-1] < SMALLEST_SINGULAR_VALUE * singular[0]:
        members = _find_members(names, directions[-1])
        raise NotDeterminedError(
            f"{_join(members)}: not determined, since the traces tell them from each other no"
            " better than rounding does"
        )


def find_undetermined(
    names: Sequence[str], covariance: FloatArray, scales: FloatArray
) -> tuple[str, ...]:
    """Name the combinations that the data leave open.

    Parameters
    ----------
    covariance : ndarray, shape (p, p)
        Of the parameters.
    scales : ndarray, shape (p,)
        What an uncertainty of each is large or small against: its value, as a rule.

    Returns
    -------
    tuple of str
        One sentence for each principal axis of the relative covariance that is longer than
        `LARGEST_RELATIVE_UNCERTAINTY`; empty: everything is determined.
    """
    relative = covariance / np.outer(scales, scales)
    standard = np.sqrt(np.diag(relative))
    variances, axes = np.linalg.eigh(relative)
    found = []
    for variance, axis in zip(variances[::-1], axes.T[::-1], strict=True):
        if variance <= LARGEST_RELATIVE_UNCERTAINTY**2:
            break
        members = _find_members(names, axis)
        figures = ", ".join(
            f"{name} \N{PLUS-MINUS SIGN}{100.0 * float(standard[names.index(name)]):.2g} %"
            for name in members
        )
        if len(members) == 1:
            found.append(f"{members[0]}: not determined by these traces ({figures})")
        else:
            found.append(f"{_join(members)}: determined only in combination ({figures})")
    return tuple(found)


def describe_misfit(model: str, residual: FloatArray) -> tuple[str, ...]:
    """Say which traces the model does not describe, so that its parameters mean little.

    Parameters
    ----------
    model : str
        Which model, in words.
    residual : ndarray, shape (2,)
        RMS residual of hammer and sample over the peak [-].
    """
    return tuple(
        f"everything: {model} does not describe the {trace}'s trace, of whose peak it leaves"
        f" {100.0 * part:.2g} %"
        for trace, part in zip(TRACES, residual, strict=True)
        if part > LARGEST_RESIDUAL
    )


def explain_covariance(model: str, residual: FloatArray, factors: FloatArray) -> tuple[str, ...]:
    """Say which traces the covariance was scaled up for, noticeably.

    Parameters
    ----------
    model : str
        Which model, in words.
    residual : ndarray, shape (2,)
        RMS residual of hammer and sample over the peak [-].
    factors : ndarray, shape (2,)
        Residual over noise [-].
    """
    return tuple(
        f"{model} leaves {100.0 * part:.2g} % of the {trace}'s peak, {factor:.2g} times its"
        " noise: the covariance is scaled up by the square of that"
        for trace, part, factor in zip(TRACES, residual, factors, strict=True)
        if factor**2 > GOOD_CHI_SQUARE
    )


def _find_members(names: Sequence[str], axis: FloatArray) -> list[str]:
    parts = np.abs(axis)
    return [
        name for name, part in zip(names, parts, strict=True) if part >= MEMBER_PART * parts.max()
    ]


def _join(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
