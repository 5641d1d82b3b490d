"""What the population matchers share: a raster of the reference, a search over it, a local refinement."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from hsslam.kernels.random import seed_of, seeds_of
from hsslam.kernels.raster import Raster
from hsslam.kernels.surface import Surface, scan_lines
from hsslam.matching.interface import MINIMUM_POINTS, Matcher, MatcherConfig, Reference, SearchWindow, clean
from hsslam.matching.results import Estimate, Matches
from hsslam.se2 import Points, Pose, Poses
from hsslam.search.batch import Batch, part, settle_all
from hsslam.search.fitness import FitnessName, HitFitness, build_raster
from hsslam.search.settle import settle

NO_TRACE: NDArray[np.float64] = np.empty((0, 4))
"""Nothing is traced."""


class PopulationConfig(MatcherConfig):
    """Parameters of the fitness and the refinement."""

    fitness: FitnessName = Field(
        default="sides",
        description="`paper`: squares around the points; `surface`: squares along the segments between them; `sides`: "
        "of these, those of the side of a wall that the scan sees; `likelihood`: a smooth field around them",
    )
    half_side: float = Field(
        default=0.05, gt=0.0, le=1.0, description="half side of the squares of the fitness (m)"
    )
    resolution: float = Field(
        default=0.025, gt=0.0, le=0.5, description="side of a raster cell of the fitness (m)"
    )
    refine: bool = Field(
        default=True, description="polish the best pose by Gauss-Newton on the lines of both scans"
    )
    search_points: int = Field(
        default=96,
        ge=10,
        description="points of the scan that the search looks at, spread over it, in a window of the paper's size "
        "and where a refinement follows, which uses all",
    )
    refine_iterations: int = Field(default=40, ge=1, description="iterations of the refinement, at most")


class PopulationReference(Reference):
    """A reference with the rasters that the search looks points up in."""

    def __init__(
        self,
        points: Points,
        config: PopulationConfig,
        surface: Surface | None = None,
        raster: Raster | None = None,
    ) -> None:
        super().__init__(points, surface)
        self._config = config
        self.raster: Raster = raster if raster is not None else self._build(1.0)

    @cached_property
    def coarse(self) -> Raster:
        """Squares and cells twice as large: what a search over a wide window can see from afar."""
        return self._build(2.0)

    def extended(self, points: Points) -> PopulationReference:
        """The reference with (N, 2) more points; takes this one's rasters over."""
        known = len(self.surface.segments)
        surface = self.surface.extended(points)
        every = np.vstack((self.points, points))
        # A plugin's raster may follow from all the points in any way: only our own are known to grow.
        raster = None
        if self._config.fitness == "paper":
            raster = self.raster.extended(np.hstack((points, points)), np.zeros((len(points), 8)))
        elif self._config.fitness in ("surface", "sides", "likelihood"):
            raster = self.raster.extended(surface.segments[known:], surface.pieces[known:])
        return PopulationReference(every, self._config, surface, raster)

    def _build(self, scale: float) -> Raster:
        config = self._config
        return build_raster(
            config.fitness, self.points, self.surface, scale * config.half_side, scale * config.resolution
        )


PopulationConfigT = TypeVar("PopulationConfigT", bound=PopulationConfig)


class PopulationMatcher(Matcher[PopulationConfigT], Generic[PopulationConfigT]):
    """Base of matchers that search the window with a population, then refine the best pose.

    A subclass writes `search`; a config of its own extends `PopulationConfig`.
    """

    def prepare(self, points: Points) -> PopulationReference:
        """Rasterise a reference; see `hsslam.matching.Matcher.prepare`."""
        return PopulationReference(clean(points), self.config)

    def extend(self, reference: Reference, points: Points) -> PopulationReference:
        """Stamp more points into the rasters; see `hsslam.matching.Matcher.extend`."""
        assert isinstance(reference, PopulationReference)
        return reference.extended(clean(points))

    def is_wide(self, window: SearchWindow) -> bool:
        """Whether to search a window on the coarse raster."""
        return False

    @abstractmethod
    def search(
        self,
        fitness: HitFitness,
        guess: Pose,
        window: SearchWindow,
        rng: np.random.Generator,
        trace: NDArray[np.float64] = NO_TRACE,
    ) -> tuple[Pose, int, int]:
        """Find the pose with most hits: the pose, its hits, evaluations spent.

        ``trace``, float64 (E, 4), is filled with the best pose and its hits after each of the first E
        evaluations: what convergence plots are made from.
        """

    def search_all(
        self,
        raster: Raster,
        batch: Batch,
        most: int,
        window: SearchWindow,
        rng: np.random.Generator,
    ) -> tuple[Poses, NDArray[np.int64]]:
        """`search` for each scan of a batch, of which ``most`` points count: poses (N, 3), evaluations spent (N,).

        A subclass whose search is a kernel overrides it with one that stays there from scan to scan.
        """
        found, spent = np.empty((len(batch), 3)), np.empty(len(batch), dtype=np.int64)
        for i, guess in enumerate(batch.guesses):
            fitness = HitFitness.of(raster, batch.scan(i), most, part(batch.lines, batch.ends, i))
            found[i], _, spent[i] = self.search(fitness, guess, window, rng)
        return found, spent

    def match_many(
        self,
        reference: Reference,
        scans: Sequence[Points],
        guesses: Poses,
        window: SearchWindow,
        rng: np.random.Generator,
    ) -> Matches:
        """Match a batch in kernels; see `hsslam.matching.Matcher.match_many`."""
        scans = [clean(scan) for scan in scans]
        fewest = min(map(len, (reference.points, *scans)))
        # Whoever wrote an `estimate` of their own means it; and `match` knows what to say of too few points.
        plain = type(self).estimate is PopulationMatcher.estimate and np.isfinite(guesses).all()
        if not scans or not plain or fewest < MINIMUM_POINTS or guesses.shape != (len(scans), 3):
            return super().match_many(reference, scans, guesses, window, rng)
        assert isinstance(reference, PopulationReference)
        config, batch = self.config, Batch.of(scans, guesses)
        wide = self.is_wide(window)
        raster = reference.coarse if wide else reference.raster
        few = config.refine and not wide
        found, _ = self.search_all(
            raster, batch, config.search_points if few else len(batch.points), window, rng
        )
        surface = reference.surface
        return Matches(
            *settle_all(
                surface.pieces,
                surface.tilts,
                surface.nearest,
                surface.frame,
                raster.cells,
                raster.frame,
                batch.points,
                batch.lines,
                batch.ends,
                batch.guesses,
                found,
                window.half,
                config.refine_iterations if config.refine else 0,
                0.0 if wide else config.half_side,
                config.score_distance,
            )
        )

    def estimate(
        self,
        reference: Reference,
        points: Points,
        guess: Pose,
        window: SearchWindow,
        rng: np.random.Generator,
    ) -> Estimate:
        """Search, then refine; see `hsslam.search.polish` and, for corridors, `hsslam.search.slide`."""
        assert isinstance(reference, PopulationReference)
        wide = self.is_wide(window)
        raster = reference.coarse if wide else reference.raster
        few = self.config.refine and not wide
        lines = scan_lines(points)
        fitness = HitFitness.of(raster, points, self.config.search_points if few else None, lines)
        found, hits, evaluations = self.search(fitness, guess, window, rng)
        diagnostics: dict[str, Any] = {"fitness": fitness.share(hits)}
        if not self.config.refine:
            return Estimate(found, evaluations=evaluations, diagnostics=diagnostics, lines=lines)
        surface = reference.surface
        pose, diagnostics["refine_iterations"], looked = settle(
            surface.pieces,
            surface.nearest,
            surface.frame,
            raster.cells,
            raster.frame,
            points,
            lines,
            found,
            guess,
            window.half,
            self.config.refine_iterations,
            0.0 if wide else self.config.half_side,
        )
        return Estimate(pose, evaluations=evaluations + looked, diagnostics=diagnostics, lines=lines)


class KernelMatcher(PopulationMatcher[PopulationConfigT], Generic[PopulationConfigT]):
    """Base of matchers whose search is a kernel, of one scan or of a batch.

    A subclass names the two kernels, which begin and end alike: see `hsslam.search.harmony.harmony_search` and
    `harmony_search_all`. What is between window and seed is theirs, and comes from `settings`.
    """

    side_by_side = True
    kernel: ClassVar[Callable[..., tuple[Pose, int, int]]]
    kernel_all: ClassVar[Callable[..., tuple[Poses, NDArray[np.int64]]]]

    @abstractmethod
    def settings(self, window: SearchWindow) -> tuple[Any, ...]:
        """What the kernels are told of a search in a window."""

    def search(
        self,
        fitness: HitFitness,
        guess: Pose,
        window: SearchWindow,
        rng: np.random.Generator,
        trace: NDArray[np.float64] = NO_TRACE,
    ) -> tuple[Pose, int, int]:
        """See `PopulationMatcher.search`."""
        return self.kernel(
            fitness.cells,
            fitness.frame,
            fitness.scaled,
            fitness.count,
            guess,
            window.half,
            *self.settings(window),
            seed_of(rng),
            trace,
        )

    def search_all(
        self,
        raster: Raster,
        batch: Batch,
        most: int,
        window: SearchWindow,
        rng: np.random.Generator,
    ) -> tuple[Poses, NDArray[np.int64]]:
        """See `PopulationMatcher.search_all`."""
        return self.kernel_all(
            raster.cells,
            raster.frame,
            batch.points,
            batch.lines,
            batch.ends,
            batch.guesses,
            most,
            window.half,
            *self.settings(window),
            seeds_of(rng, len(batch)),
        )
