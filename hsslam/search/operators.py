"""How new points are made from a population, in any number of variables, all points of a batch at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hsslam.search.options import ImprovedHarmony
from hsslam.search.problem import Box, Floats


def schedule(options: ImprovedHarmony, shares: Floats) -> tuple[Floats, Floats]:
    """PAR and BW (a share of the range) after these shares of the budget (paper, equations 2 and 3).

    The paper's t / NI counts improvisations; HIDE's differential steps spend from the same budget, so there it is
    the share of all evaluations.
    """
    rate = (
        options.pitch_adjusting_rate_min
        + (options.pitch_adjusting_rate_max - options.pitch_adjusting_rate_min) * shares
    )
    bandwidth = options.bandwidth_max * (options.bandwidth_min / options.bandwidth_max) ** shares
    return rate, bandwidth


@dataclass(frozen=True, eq=False)
class Improvisations:
    """The random choices of K improvisations, none of which depends on what the memory holds.

    ``places``: which of the memory's numbers is considered; ``kept``: whether it is; ``offsets``: what is added to
    it, or stands in its place. All (K, N).
    """

    places: NDArray[np.int64]
    kept: NDArray[np.bool_]
    offsets: Floats
    box: Box

    @classmethod
    def draw(
        cls,
        box: Box,
        memory_size: int,
        memory_considering_rate: float,
        rates: Floats,
        bandwidths: Floats,
        rng: np.random.Generator,
    ) -> Improvisations:
        """Draw as many as there are ``rates`` (PAR) and ``bandwidths`` (BW, a share of the range), both (K,).

        Equation 8 writes plus-minus, and Algorithm 1 multiplies by r ~ U(0, 1): we toss a fair coin for the sign,
        so that a number moves uniformly by up to the bandwidth either way.
        """
        shape = (len(rates), box.size)
        kept = rng.random(shape) <= memory_considering_rate
        adjusted = rng.random(shape) <= rates[:, None]
        moves = (2.0 * rng.random(shape) - 1.0) * bandwidths[:, None] * box.span
        places = rng.integers(memory_size, size=shape) * box.size + np.arange(box.size)
        fresh = box.draw(len(rates), rng)
        return cls(places, kept, np.where(kept, np.where(adjusted, moves, 0.0), fresh), box)

    def improvise(self, k: int, memory: Floats) -> Floats:
        """The k-th new harmony (N,), from a memory (M, N) (paper, Algorithm 1, equations 7 and 8)."""
        return self.box.clip(memory.take(self.places[k]) * self.kept[k] + self.offsets[k])


def partners(count: int, rng: np.random.Generator) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """For each of ``count`` members two others, different from it and from each other, (count,) each.

    "Should be different from the running index r1, r2" (paper, under equation 11) is read so, as is usual.
    """
    targets = np.arange(count)
    first = rng.integers(count - 1, size=count)
    first += first >= targets
    second = rng.integers(count - 2, size=count)
    second += second >= np.minimum(first, targets)
    second += second >= np.maximum(first, targets)
    return first, second


def evolve(
    members: Floats, bases: Floats, weight: float, crossover_rate: float, box: Box, rng: np.random.Generator
) -> Floats:
    """Trial vectors (M, N) of members (M, N) (paper, equations 11 and 12).

    ``bases`` plus ``weight`` times the difference of two other members, then crossover with the member. The paper
    names neither kind nor rate of the crossover: it is binomial, with at least one variable from the mutant.
    """
    first, second = partners(len(members), rng)
    mutants = bases + weight * (members[first] - members[second])
    crossed = rng.random(members.shape) < crossover_rate
    crossed[np.arange(len(members)), rng.integers(members.shape[1], size=len(members))] = True
    return box.clip(np.where(crossed, mutants, members))


def attracted(members: Floats, best: int, attraction: float) -> Floats:
    """Members (M, N) moved towards the best of them (paper, equation 12)."""
    moved: Floats = members + attraction * (members[best] - members)
    return moved


def tournaments(
    energies: Floats, count: int, contestants: int, rng: np.random.Generator
) -> NDArray[np.int64]:
    """Winners (count,) of tournaments among random members of energies (M,)."""
    drawn = rng.integers(len(energies), size=(count, contestants))
    winners: NDArray[np.int64] = drawn[np.arange(count), np.argmin(energies[drawn], axis=1)]
    return winners
