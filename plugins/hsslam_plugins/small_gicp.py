"""GICP by the small_gicp package (Koide 2024; Segal et al., "Generalized-ICP", 2009), in the plane."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from hsslam.matching import (
    Estimate,
    Matcher,
    MatcherUnavailableError,
    Points,
    Pose,
    Reference,
    SearchWindow,
    clean,
)
from hsslam.search.point_to_line import SWING
from hsslam_plugins.local import LocalConfig, planar_pose, transformation

INSTALL = "pip install 'hsslam[small-gicp]'"


class SmallGicpConfig(LocalConfig):
    """Parameters of the registration, run twice: coarse, then fine."""

    layer_distance: float = Field(
        default=0.1,
        gt=0.0,
        description="points are copied this far above and below the plane (m), so that a wall becomes a plane "
        "that a covariance can be fitted to",
    )
    neighbours: int = Field(
        default=10, ge=5, description="points that a point's covariance is fitted to, copies included"
    )
    distance_start: float = Field(
        default=0.5, gt=0.0, description="reach of a correspondence in the coarse run (m)"
    )
    distance_end: float = Field(
        default=0.2, gt=0.0, description="reach of a correspondence in the fine run (m)"
    )
    max_iterations: int = Field(default=30, ge=1, description="iterations of a run, at most")
    translation_tolerance: float = Field(
        default=1e-4, gt=0.0, description="a run ends with a step shorter than this (m)"
    )
    rotation_tolerance: float = Field(default=1e-4, gt=0.0, description="and a turn smaller than this (rad)")

    @model_validator(mode="after")
    def _shrinking(self) -> SmallGicpConfig:
        if self.distance_end > self.distance_start:
            raise ValueError("distance_end is larger than distance_start")
        return self


class SmallGicpReference(Reference):
    """A reference as three layers of points with covariances, and their tree."""

    def __init__(self, points: Points, config: SmallGicpConfig) -> None:
        super().__init__(points)
        self.cloud: Any = None
        self.tree: Any = None
        if len(points):
            self.cloud, self.tree = layered_cloud(points, config)


class SmallGicp(Matcher[SmallGicpConfig]):
    """Generalised ICP: distances between points are weighed by how points spread around each (small_gicp)."""

    Config = SmallGicpConfig
    summary = "generalised ICP, coarse to fine (small_gicp; Koide 2024)"

    @classmethod
    def check_available(cls) -> None:
        """Import small_gicp, and say what is missing where that fails."""
        package()

    def prepare(self, points: Points) -> SmallGicpReference:
        """Fit the covariances; see `hsslam.matching.Matcher.prepare`."""
        return SmallGicpReference(clean(points), self.config)

    def estimate(
        self,
        reference: Reference,
        points: Points,
        guess: Pose,
        window: SearchWindow,
        rng: np.random.Generator,
    ) -> Estimate:
        """Start at the guess; the coarse run's answer starts the fine run."""
        assert isinstance(reference, SmallGicpReference)
        config, align = self.config, package().align
        scan, _ = layered_cloud(points, config)

        def run(start: NDArray[np.float64], distance: float, most: int) -> Any:
            # One thread: sums taken in parallel would differ in their last digits from call to call.
            return align(
                reference.cloud,
                scan,
                reference.tree,
                init_T_target_source=start,
                registration_type="GICP",
                max_correspondence_distance=distance,
                num_threads=1,
                max_iterations=most,
                rotation_epsilon=config.rotation_tolerance,
                translation_epsilon=config.translation_tolerance,
            )

        coarse = run(transformation(guess), config.distance_start, config.max_iterations)
        fine = run(coarse.T_target_source, config.distance_end, config.max_iterations)
        pose, iterations = planar_pose(fine.T_target_source), int(coarse.iterations) + int(fine.iterations)
        converged = bool(fine.converged)
        if not converged:
            # Points that change partners to and fro keep the pose swinging, mostly by millimetres.
            last = run(fine.T_target_source, config.distance_end, 2)
            iterations += int(last.iterations)
            converged = bool((np.abs(planar_pose(last.T_target_source) - pose) < SWING).all())
        return Estimate(
            window.keep(guess, pose, config.window_slack),
            # Three copies of three points: what fixes a pose in the plane.
            converged=converged and int(fine.num_inliers) >= 9,
            evaluations=iterations,
        )


def layered_cloud(points: Points, config: SmallGicpConfig) -> tuple[Any, Any]:
    """Make three copies of (N, 2) points, one above and one below the plane: their cloud and tree.

    A planar cloud has no extent along z, and a covariance regularised to a disc then lies in the plane for
    every point, so that it tells no wall from any other.
    """
    library = package()
    layers = [
        np.column_stack((points, np.full(len(points), height)))
        for height in (-config.layer_distance, 0.0, config.layer_distance)
    ]
    cloud = library.PointCloud(np.vstack(layers))
    tree = library.KdTree(cloud, num_threads=1)
    library.estimate_covariances(cloud, tree, num_neighbors=config.neighbours, num_threads=1)
    return cloud, tree


def package() -> Any:
    """Import small_gicp.

    Raises
    ------
    MatcherUnavailableError
        It is missing or does not work.
    """
    try:
        import small_gicp
    except ModuleNotFoundError as error:
        raise MatcherUnavailableError(
            "small_gicp", "the package small_gicp is not installed", INSTALL
        ) from error
    except ImportError as error:
        reason = f"small_gicp cannot be imported: {error}"
        raise MatcherUnavailableError("small_gicp", reason, f"{INSTALL} --force-reinstall") from error
    return small_gicp
