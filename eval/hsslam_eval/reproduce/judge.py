"""Whether a claim of the paper holds: paired comparisons over the same trials."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from hsslam_eval.reproduce.experiment import Claim
from hsslam_eval.statistics import Interval, bootstrap_interval


def paired(
    first: ArrayLike, second: ArrayLike, statistic: Literal["mean", "median"] = "mean", seed: int = 0
) -> Interval:
    """Mean (or median) of ``first - second`` over the same trials, with its 95% bootstrap interval."""
    difference = np.asarray(first, dtype=np.float64) - np.asarray(second, dtype=np.float64)
    return bootstrap_interval(difference, statistic, seed=seed)


def compare(
    statement: str,
    difference: Interval,
    expected: Literal["smaller", "larger"],
    *,
    this: str,
    other: str,
    what: str,
    unit: str,
    scale: float = 1.0,
) -> Claim:
    """Judge "``this`` has the smaller (larger) ``what`` than ``other``".

    It holds where the whole interval of the difference lies on the claimed side of zero.

    Parameters
    ----------
    statement : str
        The claim in words.
    difference : Interval
        This minus other, from `paired`.
    expected : {"smaller", "larger"}
        What the paper says of ``this``.
    this, other, what : str
        Names for the sentence.
    unit, scale : str, float
        To print the difference in.
    """
    if not math.isfinite(difference.value):
        return Claim(statement, "cannot be compared", f"There is no trial to compare {what} on.")
    value, low, high = (f"{scale * v:+.3g}" for v in (difference.value, difference.low, difference.high))
    figures = f"{this} minus {other}: {value} {unit} (95% interval {low} to {high})"
    if difference.low <= 0.0 <= difference.high:
        return Claim(
            statement, "does not hold", f"No difference in {what} that these trials can tell: {figures}."
        )
    found = "smaller" if difference.high < 0.0 else "larger"
    return Claim(
        statement,
        "holds" if found == expected else "does not hold",
        f"{what[:1].upper()}{what[1:]} of {this} is {found}: {figures}.",
    )


def no_worse(
    statement: str,
    excess: Interval,
    margin: float,
    *,
    this: str,
    other: str,
    what: str,
    unit: str,
    scale: float = 1.0,
) -> Claim:
    """Judge "``this`` does as well as ``other``": how much worse it is stays below a margin.

    Parameters
    ----------
    excess : Interval
        By how much ``this`` is worse (positive: worse), from `paired`.
    margin : float
        What counts as no difference, in the unit of ``excess``.
    statement, this, other, what, unit, scale
        As for `compare`.
    """
    if not math.isfinite(excess.value):
        return Claim(statement, "cannot be compared", f"There is no trial to compare {what} on.")
    low, high = (f"{scale * v:+.3g}" for v in (excess.low, excess.high))
    side = "worse" if excess.value > 0.0 else "better"
    size = f"{scale * abs(excess.value):.3g} {unit}"
    figures = f"{this}: {size} {side} than {other} in {what} (95% interval of the loss {low} to {high})"
    limit = f"a margin of {scale * margin:.3g} {unit}"
    if excess.high < margin:
        return Claim(statement, "holds", f"{figures}, which is within {limit}.")
    if excess.low > margin:
        return Claim(statement, "does not hold", f"{figures}, which is beyond {limit}.")
    return Claim(statement, "cannot be compared", f"{figures}: too few trials to tell by {limit}.")


def tally(claims: Sequence[Claim]) -> str:
    """How many claims hold, in words; comparisons that we added are counted apart."""
    made = [claim for claim in claims if not claim.added]
    added = [claim for claim in claims if claim.added]
    if not made:
        text = "The paper claims nothing here that could be checked."
    else:
        unknown = sum(claim.verdict == "cannot be compared" for claim in made)
        text = f"{_held(made)} of {len(made)} claims of the paper hold on these data"
        text += f"; {unknown} cannot be compared." if unknown else "."
    return f"{text} Of {len(added)} comparisons that we added, {_held(added)} hold." if added else text


def _held(claims: Sequence[Claim]) -> int:
    return sum(claim.verdict == "holds" for claim in claims)
