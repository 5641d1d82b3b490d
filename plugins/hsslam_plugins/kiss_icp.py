"""KISS-ICP in the plane: the registration of Vizzo et al., "In defense of point-to-point ICP" (2023)."""

from __future__ import annotations

from typing import Any

import numpy as np
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
from hsslam_plugins.local import LocalConfig, in_space, planar_pose, transformation

INSTALL = "pip install 'hsslam[kiss-icp]'"

UNLIMITED = 1e6
"""Distance (m) from the origin at which the voxel map would drop points: never."""


class KissIcpConfig(LocalConfig):
    """Parameters of KISS-ICP's voxel map and registration, run twice: coarse, then fine."""

    voxel_size: float = Field(
        default=0.7,
        gt=0.0,
        description="side of a voxel of the reference (m); a correspondence is sought in a voxel and its "
        "neighbours only, so this bounds its reach: small voxels lose a match silently, large ones are slow",
    )
    points_per_voxel: int = Field(
        default=150,
        ge=1,
        description="points a voxel holds, at most; it takes none closer to another than "
        "voxel_size / sqrt(this), so this sets how finely the reference is sampled (the package's own "
        "20 is meant for 3D and too coarse here)",
    )
    distance_start: float = Field(
        default=0.7, gt=0.0, description="reach of a correspondence in the coarse run (m)"
    )
    distance_end: float = Field(
        default=0.2, gt=0.0, description="reach of a correspondence in the fine run (m)"
    )
    robust_scale_start: float = Field(
        default=0.15, gt=0.0, description="scale of the Geman-McClure weight in the coarse run (m)"
    )
    robust_scale_end: float = Field(
        default=0.05, gt=0.0, description="scale of the Geman-McClure weight in the fine run (m)"
    )
    max_iterations: int = Field(default=500, ge=1, description="iterations of a run, at most")
    tolerance: float = Field(
        default=1e-4, gt=0.0, description="a run ends with a step shorter than this (m and rad)"
    )

    @model_validator(mode="after")
    def _within_reach(self) -> KissIcpConfig:
        if self.distance_start > self.voxel_size:
            raise ValueError(
                "distance_start is larger than voxel_size, beyond which no correspondence is found"
            )
        if self.distance_end > self.distance_start:
            raise ValueError("distance_end is larger than distance_start")
        if self.robust_scale_end > self.robust_scale_start:
            raise ValueError("robust_scale_end is larger than robust_scale_start")
        return self


class KissIcpReference(Reference):
    """A reference as a voxel map."""

    def __init__(self, points: Points, config: KissIcpConfig) -> None:
        super().__init__(points)
        self.voxels: Any = package().mapping.VoxelHashMap(
            config.voxel_size, UNLIMITED, config.points_per_voxel
        )
        self.voxels.add_points(in_space(points))

    def extended(self, points: Points) -> KissIcpReference:
        """Add (N, 2) points to this very reference."""
        self.adopt(self.surface.extended(points))
        self.points = np.vstack((self.points, points))
        self.voxels.add_points(in_space(points))
        return self


class KissIcp(Matcher[KissIcpConfig]):
    """Point-to-point ICP on a voxel map with a Geman-McClure weight (the kiss-icp package), z = 0.

    The package tells neither its iterations nor whether it converged: ``evaluations`` is 0, and ``converged``
    says only that the answer is inside the window.
    """

    Config = KissIcpConfig
    summary = "point-to-point ICP on a voxel map (KISS-ICP; Vizzo et al. 2023)"

    @classmethod
    def check_available(cls) -> None:
        """Import kiss-icp, and say what is missing where that fails."""
        package()

    def prepare(self, points: Points) -> KissIcpReference:
        """Fill the voxel map; see `hsslam.matching.Matcher.prepare`."""
        return KissIcpReference(clean(points), self.config)

    def extend(self, reference: Reference, points: Points) -> KissIcpReference:
        """Add the points to the voxel map; see `hsslam.matching.Matcher.extend`."""
        assert isinstance(reference, KissIcpReference)
        return reference.extended(clean(points))

    def estimate(
        self,
        reference: Reference,
        points: Points,
        guess: Pose,
        window: SearchWindow,
        rng: np.random.Generator,
    ) -> Estimate:
        """Start at the guess; the coarse run's answer starts the fine run."""
        assert isinstance(reference, KissIcpReference)
        config = self.config
        # One thread: sums taken in parallel would differ in their last digits from call to call.
        registration = package().registration.Registration(
            max_num_iterations=config.max_iterations,
            convergence_criterion=config.tolerance,
            max_num_threads=1,
        )
        scan = in_space(points)
        matrix = transformation(guess)
        for distance, scale in (
            (config.distance_start, config.robust_scale_start),
            (config.distance_end, config.robust_scale_end),
        ):
            matrix = registration.align_points_to_map(scan, reference.voxels, matrix, distance, scale)
        return Estimate(window.keep(guess, planar_pose(matrix), config.window_slack))


def package() -> Any:
    """Import the parts of kiss-icp that are used.

    Raises
    ------
    MatcherUnavailableError
        It is missing or does not work.
    """
    try:
        import kiss_icp
        import kiss_icp.mapping
        import kiss_icp.registration
    except ModuleNotFoundError as error:
        if error.name != "kiss_icp":
            reason = f"kiss-icp needs the package {error.name}, which is not installed"
            raise MatcherUnavailableError("kiss_icp", reason, INSTALL) from error
        raise MatcherUnavailableError("kiss_icp", "the package kiss-icp is not installed", INSTALL) from error
    except ImportError as error:
        reason = f"kiss-icp cannot be imported: {error}"
        raise MatcherUnavailableError("kiss_icp", reason, f"{INSTALL} --force-reinstall") from error
    return kiss_icp
