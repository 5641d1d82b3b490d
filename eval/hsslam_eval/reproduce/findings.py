"""What an experiment gathers as it goes from one set of pairs to the next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from hsslam_eval.reproduce.data import attribution, describe
from hsslam_eval.reproduce.experiment import Claim, Drawing, Experiment, Request, Table


@dataclass(eq=False)
class Findings:
    """Tables, figures, verdicts and curves so far."""

    request: Request
    tables: list[Table] = field(default_factory=list)
    drawings: list[Drawing] = field(default_factory=list)
    claims: list[Claim] = field(default_factory=list)
    series: dict[str, Any] = field(default_factory=dict)

    def experiment(
        self,
        name: str,
        title: str,
        *,
        summary: str,
        counts: dict[str, int],
        config: dict[str, Any],
        notes: Sequence[str] = (),
    ) -> Experiment:
        """Make the experiment of them; data and seed are the request's, the rest is as `Experiment` has it."""
        return Experiment(
            name=name,
            title=title,
            summary=summary,
            claims=tuple(self.claims),
            tables=tuple(self.tables),
            drawings=tuple(self.drawings),
            data=describe(self.request),
            attribution=attribution(self.request),
            seeds=(self.request.seed,),
            counts=counts,
            config=config,
            notes=tuple(notes),
            series=self.series,
        )
