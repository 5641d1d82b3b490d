"""The experiments of Tables 1 and 2: the duel over every set of pairs, laid out, drawn and judged."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from hsslam_eval.reproduce import duel
from hsslam_eval.reproduce.data import pair_sets
from hsslam_eval.reproduce.duel import Bouts, Published
from hsslam_eval.reproduce.duel_figure import draw
from hsslam_eval.reproduce.experiment import Claim, Experiment, Request, Tell
from hsslam_eval.reproduce.findings import Findings
from hsslam_eval.reproduce.methods import Method, oracle

_BOUND = (
    "The proven best pose of the published fitness is what a search would find that never failed. Where even that "
    "succeeds less often than the paper's methods did, the fitness limits them on these data: a search does better by "
    "luck alone."
)


def hold(
    request: Request,
    tell: Tell,
    contestants: Sequence[Method],
    paper: Mapping[tuple[str, float], Published],
    judge: Callable[[Bouts, str], Sequence[Claim]],
    *,
    name: str,
    title: str,
    summary: str,
    notes: Sequence[str],
) -> Experiment:
    """Hold a duel.

    Parameters
    ----------
    request, tell
        As for every experiment.
    contestants : sequence of Method
        Rows of the table; a last one is the best pose that the published fitness has to offer.
    paper : mapping
        The paper's rows, by method and side of the window (m).
    judge : callable
        Claims, given the bouts over a set of pairs and its name.
    name, title, summary, notes
        As `Experiment` has them.
    """
    count = request.count(1000, 60)
    best = oracle()
    if best is not None:
        contestants = (*contestants, best)
        notes = (*notes, _BOUND)
    found = Findings(request)
    for pairs in pair_sets(request, count):
        bouts = duel.fight(request, contestants, pairs, count, tell)
        found.tables.append(duel.table(bouts, paper, pairs, contestants))
        found.drawings.append(draw(bouts, paper, contestants, pairs))
        found.claims.extend(judge(bouts, pairs.key))
    return found.experiment(
        name,
        title,
        summary=summary,
        counts={"trials per method and window": count},
        config=duel.described(contestants),
        notes=tuple(notes),
    )
