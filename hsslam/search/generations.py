"""The genetic algorithms of `hsslam.search.minimize`: GLASM's, on Gray-coded bits, and one on real numbers."""

from __future__ import annotations

from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from hsslam.search.operators import tournaments
from hsslam.search.options import Genetic
from hsslam.search.problem import Box, Floats, Problem

GenesT = TypeVar("GenesT", bound=np.generic)


class Code(Protocol[GenesT]):
    """How a point is written as genes, (M, G) for M points, and how genes change."""

    def encode(self, points: Floats) -> NDArray[GenesT]:
        """Genes of points (M, N)."""

    def decode(self, genes: NDArray[GenesT]) -> Floats:
        """Points of genes (M, G)."""

    def cross(
        self, mothers: NDArray[GenesT], fathers: NDArray[GenesT], rng: np.random.Generator
    ) -> NDArray[GenesT]:
        """Children of as many couples."""

    def mutate(self, genes: NDArray[GenesT], which: NDArray[np.int64], rng: np.random.Generator) -> None:
        """Change those ``which`` mutate, in place."""


class Gray:
    """Gray-coded bits, one variable after another, the most significant bit first."""

    def __init__(self, box: Box, bits: int) -> None:
        self._box = box
        self._bits = bits
        self._worth = 2.0 ** np.arange(bits - 1, -1, -1) / (2.0**bits - 1.0)

    def encode(self, points: Floats) -> NDArray[np.uint8]:
        """See `Code`; the nearest code."""
        span = self._box.span
        share = np.divide(points - self._box.low, span, out=np.zeros_like(points), where=span > 0.0)
        code = np.round(share * (2.0**self._bits - 1.0)).astype(np.int64)
        gray = code ^ (code >> 1)
        bits = gray[:, :, None] >> np.arange(self._bits - 1, -1, -1) & 1
        return bits.astype(np.uint8).reshape(len(points), -1)

    def decode(self, genes: NDArray[np.uint8]) -> Floats:
        """See `Code`."""
        binary = np.bitwise_xor.accumulate(genes.reshape(len(genes), -1, self._bits), axis=2)
        return self._box.clip(self._box.low + binary @ self._worth * self._box.span)

    def cross(
        self, mothers: NDArray[np.uint8], fathers: NDArray[np.uint8], rng: np.random.Generator
    ) -> NDArray[np.uint8]:
        """One-point crossover of the whole chromosome."""
        points = rng.integers(1, mothers.shape[1], size=(len(mothers), 1))
        return np.where(np.arange(mothers.shape[1]) < points, mothers, fathers)

    def mutate(self, genes: NDArray[np.uint8], which: NDArray[np.int64], rng: np.random.Generator) -> None:
        """Flip a bit."""
        genes[which, rng.integers(genes.shape[1], size=len(which))] ^= 1


class Real:
    """The numbers themselves."""

    _BLEND = 0.5

    def __init__(self, box: Box, mutation_scale: float) -> None:
        self._box = box
        self._deviation = mutation_scale * box.span

    def encode(self, points: Floats) -> Floats:
        """See `Code`."""
        return points.copy()

    def decode(self, genes: Floats) -> Floats:
        """See `Code`."""
        return self._box.clip(genes)

    def cross(self, mothers: Floats, fathers: Floats, rng: np.random.Generator) -> Floats:
        """Blend crossover: uniform between the parents and half their distance beyond, variable by variable."""
        shares = rng.random(mothers.shape) * (1.0 + 2.0 * self._BLEND) - self._BLEND
        return self._box.clip(mothers + shares * (fathers - mothers))

    def mutate(self, genes: Floats, which: NDArray[np.int64], rng: np.random.Generator) -> None:
        """Move a variable by a Gaussian."""
        variables = rng.integers(genes.shape[1], size=len(which))
        genes[which, variables] += rng.standard_normal(len(which)) * self._deviation[variables]


def genetic(problem: Problem, options: Genetic, rng: np.random.Generator) -> tuple[Floats, Floats, int]:
    """Genetic algorithm; an iteration is a generation. See `hsslam.search.searches` for what is returned.

    The best chromosome lives on unchanged and is not evaluated again.
    """
    if options.encoding == "gray":
        return _breed(problem, options, Gray(problem.box, options.bits), rng)
    return _breed(problem, options, Real(problem.box, options.mutation_scale), rng)


def _breed(
    problem: Problem, options: Genetic, code: Code[GenesT], rng: np.random.Generator
) -> tuple[Floats, Floats, int]:
    points, energies = problem.fill(options.population_size, rng)
    genes = code.encode(points)
    iterations = 0
    while not problem.done(energies):
        count = len(genes) - 1
        mothers = genes[tournaments(energies, count, options.tournament, rng)]
        fathers = genes[tournaments(energies, count, options.tournament, rng)]
        paired = rng.random((count, 1)) < options.crossover_rate
        children = np.where(paired, code.cross(mothers, fathers, rng), mothers)
        code.mutate(children, np.flatnonzero(rng.random(count) < options.mutation_rate), rng)
        decoded = code.decode(children)
        found = problem.many(decoded)
        # The budget may end within a generation: the best of the parents fill the places of the unborn.
        survivors = np.argsort(energies, kind="stable")[: len(genes) - len(found)]
        genes = np.concatenate((genes[survivors], children[: len(found)]))
        points = np.concatenate((points[survivors], decoded[: len(found)]))
        energies = np.concatenate((energies[survivors], found))
        iterations += 1
    return points, energies, iterations
