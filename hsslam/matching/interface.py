"""The one interface: what a matcher is given and what it gives back.

A plugin subclasses `Matcher` and writes `Matcher.estimate`, which finds a pose. Everything that must mean the
same for every matcher - input checks, rejection of answers outside the window, score, covariance - happens
once, in `Matcher.match`, which plugins inherit and do not override.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Generic, TypeVar, final

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from hsslam.kernels.assess import assess
from hsslam.kernels.surface import Surface, all_finite
from hsslam.matching.results import Estimate, Matches, MatchResult
from hsslam.se2 import Points, Pose, Poses, wrap

MINIMUM_POINTS = 3
"""Fewer points than this, on either side, fix no pose."""

LEFT_WINDOW = "the answer left the search window"
"""``diagnostics["rejected"]`` of an answer that did: no fault of a local method's."""


class MatcherConfig(BaseModel):
    """Parameters every matcher has; a plugin's own come in a subclass."""

    model_config: ClassVar[ConfigDict] = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    score_distance: float = Field(
        default=0.10,
        gt=0.0,
        le=0.15,
        description="a point within this distance of the reference surface counts as matched (m)",
    )


@dataclass(frozen=True)
class SearchWindow:
    """How far the truth may be from the guess, along each axis of the reference's frame.

    Parameters
    ----------
    half_x, half_y : float
        Half sides of the box (m).
    half_theta : float
        Half its height (rad).
    """

    half_x: float
    half_y: float
    half_theta: float

    @cached_property
    def half(self) -> NDArray[np.float64]:
        """The three half sides as an array."""
        return np.array([self.half_x, self.half_y, self.half_theta])

    def contains(self, guess: Pose, pose: Pose, tolerance: float = 1e-9) -> bool:
        """Whether ``pose`` is inside the window around ``guess``; one that is not finite is not."""
        x, y, theta = pose.tolist()
        x0, y0, theta0 = guess.tolist()
        inside: bool = (
            abs(x - x0) <= self.half_x + tolerance
            and abs(y - y0) <= self.half_y + tolerance
            and abs((theta - theta0 + math.pi) % math.tau - math.pi) <= self.half_theta + tolerance
        )
        return inside

    def keep(self, guess: Pose, pose: Pose, slack: float) -> Pose:
        """Move a pose that is just outside the window around ``guess`` onto its edge; leave any other as it is.

        Noise alone carries a truth near the edge across it. ``slack`` is how far outside counts as just outside,
        as a share of the half sides.
        """
        if self.contains(guess, pose):
            return pose
        offset = pose - guess
        offset[2] = wrap(offset[2])
        if not (np.abs(offset) <= (1.0 + slack) * self.half).all():
            return pose
        return guess + np.minimum(np.maximum(offset, -self.half), self.half)


class Reference:
    """What scans are matched against: the points of a scan or of a submap, in one frame.

    A plugin that needs an index of its own (a tree, a raster) subclasses this and fills it in
    `Matcher.prepare`; one reference then serves any number of matches, from any number of threads.

    Parameters
    ----------
    points : Points
        (N, 2) m. Neighbours in the array that are close to one another are taken for neighbours on a
        surface, so keep a scan's beams in their order; scans may follow one another. The order also tells from
        which side a wall was seen: scans that are matched go round in the same sense.
    surface : Surface, optional
        Through the points, where it is known; made when it is asked for where left out.
    """

    def __init__(self, points: Points, surface: Surface | None = None) -> None:
        self.points = points
        self._surface = surface

    @property
    def surface(self) -> Surface:
        """Surface through the points: what `MatchResult.score` and the covariance are measured on."""
        if self._surface is None:
            self._surface = Surface.build(self.points)
        return self._surface

    def adopt(self, surface: Surface) -> None:
        """Take a surface through the points that somebody else made.

        Its segments may be numbered otherwise: what a plugin keeps that numbers them goes with the surface it is of.
        """
        self._surface = surface


ConfigT = TypeVar("ConfigT", bound=MatcherConfig)


class Matcher(ABC, Generic[ConfigT]):
    """Finds the pose of a scan in the frame of a reference.

    A matcher holds no state between calls beyond its config: the same inputs and the same generator give the
    same result, and two threads may use one matcher.

    Parameters
    ----------
    config : MatcherConfig, optional
        An instance of the class's ``Config``; its defaults if left out.

    Raises
    ------
    MatcherUnavailableError
        Where something the matcher needs is not installed, or does not work.
    """

    Config: ClassVar[type[MatcherConfig]] = MatcherConfig
    summary: ClassVar[str] = ""
    """One line for listings."""

    covers_window: ClassVar[bool] = False
    """Whether a window of a metre and more is searched as well as a small one. Where it is not, because the method
    is local or its effort fixed, a wide window is searched in tiles, each of them a match."""

    side_by_side: ClassVar[bool] = False
    """Whether `match_many` works mostly without the interpreter lock, so that two threads match more than one."""

    def __init__(self, config: ConfigT | None = None) -> None:
        self.check_available()
        self.config: ConfigT = config if config is not None else self.Config()  # type: ignore[assignment]

    @classmethod
    def check_available(cls) -> None:
        """Raise `MatcherUnavailableError` where a dependency is missing or broken."""

    def prepare(self, points: Points) -> Reference:
        """Make a reference of (N, 2) points; done once, used for many matches."""
        return Reference(clean(points))

    def extend(self, reference: Reference, points: Points) -> Reference:
        """Add one more scan's (N, 2) points, in the reference's frame, to what `prepare` made.

        Takes the reference over: what is returned replaces it, and it must not be used any more. A submap that
        grows scan by scan costs little this way. Made anew here, but for the surface, which grows (`Reference.adopt`);
        a plugin whose index can grow, or is of the surface's segments, overrides it.
        """
        points = clean(points)
        grown = self.prepare(np.vstack((reference.points, points)))
        grown.adopt(reference.surface.extended(points))
        return grown

    @abstractmethod
    def estimate(
        self,
        reference: Reference,
        points: Points,
        guess: Pose,
        window: SearchWindow,
        rng: np.random.Generator,
    ) -> Estimate:
        """Find the pose of ``points`` in the frame of ``reference``: the method itself.

        Called by `match` with finite points, at least `MINIMUM_POINTS` on each side. ``reference`` is what the
        plugin's own `prepare` returned. Population searches look inside ``window`` around ``guess``; local
        methods start at ``guess`` and may ignore the window: `match` rejects what left it.
        """

    @final
    def match(
        self,
        reference: Reference,
        points: Points,
        guess: Pose,
        window: SearchWindow,
        rng: np.random.Generator,
    ) -> MatchResult:
        """Match a scan.

        Parameters
        ----------
        reference : Reference
            From this matcher's `prepare`.
        points : Points
            (N, 2) m, in the frame whose pose is sought. Rows that are not finite are ignored.
        guess : Pose
            Where the scan is thought to be, in the reference's frame.
        window : SearchWindow
            How far from it the truth may be.
        rng : numpy.random.Generator
            Source of every random choice.

        Returns
        -------
        MatchResult
            With fewer than `MINIMUM_POINTS` points on a side, or an answer that is not finite or outside the
            window: the guess, ``converged=False``, and the reason under ``diagnostics["rejected"]``.

        Raises
        ------
        ValueError
            Points not of shape (N, 2), or a guess that is not three finite numbers.
        TypeError
            `estimate` returned no `Estimate`, or one whose pose is not three numbers.
        """
        points = clean(points)
        guess = np.ascontiguousarray(guess, dtype=np.float64)
        if guess.shape != (3,) or not all(map(math.isfinite, guess.tolist())):
            raise ValueError(f"a guess is three finite numbers (x m, y m, theta rad), not {guess!r}")
        if len(points) < MINIMUM_POINTS or len(reference.points) < MINIMUM_POINTS:
            few = "scan" if len(points) < MINIMUM_POINTS else "reference"
            return MatchResult(
                pose=guess.copy(),
                covariance=np.diag(np.maximum(window.half, 1e-3) ** 2),
                score=0.0,
                converged=False,
                evaluations=0,
                diagnostics={"rejected": f"the {few} has fewer than {MINIMUM_POINTS} points"},
            )
        found = self.estimate(reference, points, guess, window, rng)
        pose, converged, diagnostics = self._pose_of(found), found.converged, found.diagnostics
        covariance = found.covariance
        if not window.contains(guess, pose):
            why = LEFT_WINDOW if np.isfinite(pose).all() else "the answer is not finite"
            diagnostics = {**diagnostics, "rejected": why}
            pose, converged, covariance = guess, False, None
        pose = np.array([pose[0], pose[1], wrap(pose[2])])
        score, estimated, direction = assess(
            reference.surface, points, pose, window.half, self.config.score_distance, found.lines
        )
        if not math.isnan(direction):
            diagnostics = {**diagnostics, "degenerate_direction": direction}
        if covariance is not None and not _is_covariance(covariance):
            diagnostics = {
                **diagnostics,
                "covariance_rejected": "not a symmetric, positive definite (3, 3) matrix",
            }
            covariance = None
        if covariance is None:
            covariance = estimated
        return MatchResult(
            pose=pose,
            covariance=covariance,
            score=score,
            converged=converged,
            evaluations=found.evaluations,
            diagnostics=diagnostics,
        )

    def match_many(
        self,
        reference: Reference,
        scans: Sequence[Points],
        guesses: Poses,
        window: SearchWindow,
        rng: np.random.Generator,
    ) -> Matches:
        """Match several scans against one reference: what `match` answers to one after the other.

        Parameters
        ----------
        reference, window, rng
            As for `match`.
        scans : sequence of Points
            (N_i, 2) m each.
        guesses : Poses
            (N, 3) where they are thought to be.

        Returns
        -------
        Matches
            The scans' poses, in their order.

        Raises
        ------
        ValueError, TypeError
            As `match` does.
        """
        return Matches.of(
            [
                self.match(reference, scan, guess, window, rng)
                for scan, guess in zip(scans, guesses, strict=True)
            ]
        )

    def _pose_of(self, found: Any) -> Pose:
        """The pose of what `estimate` returned: plugins are not always typed."""
        who = f"{type(self).__name__}.estimate"
        if not isinstance(found, Estimate):
            raise TypeError(f"{who} returned {type(found).__name__}: expected hsslam.matching.Estimate")
        try:
            pose = np.asarray(found.pose, dtype=np.float64)
        except (TypeError, ValueError):
            pose, told = np.empty(0), repr(found.pose)
        else:
            told = f"of shape {pose.shape}"
        if pose.shape != (3,):
            raise TypeError(f"{who} returned a pose {told}: expected three numbers (x m, y m, theta rad)")
        return pose


def _is_covariance(matrix: NDArray[np.float64]) -> bool:
    if matrix.shape != (3, 3) or not np.isfinite(matrix).all():
        return False
    if not np.allclose(matrix, matrix.T, rtol=1e-9, atol=0.0):
        return False
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        return False
    return True


def clean(points: Points) -> Points:
    """Finite rows of ``points`` as contiguous float64 (N, 2).

    Raises
    ------
    ValueError
        If the array is not of shape (N, 2).
    """
    points = np.ascontiguousarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 2:
        raise ValueError(f"points are an array of shape (N, 2), not {points.shape}")
    if all_finite(points):
        return points
    return np.ascontiguousarray(points[np.isfinite(points).all(axis=1)])
