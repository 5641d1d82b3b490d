"""ICP: iterated closest points, point to line, by Open3D."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from hsslam.matching import (
    Estimate,
    Matcher,
    Points,
    Pose,
    Reference,
    SearchWindow,
    clean,
)
from hsslam_plugins.local import LocalConfig, in_space, planar_pose, transformation
from hsslam_plugins.open3d_library import one_thread, open3d


class IcpConfig(LocalConfig):
    """Parameters of ICP: Open3D's registration run in stages, each with a smaller reach than the last."""

    stages: int = Field(default=2, ge=1, le=10, description="registrations, from coarse to fine")
    distance_start: float = Field(
        default=0.7,
        gt=0.0,
        description="reach of a correspondence in the first stage (m); shrinks geometrically",
    )
    distance_end: float = Field(
        default=0.2, gt=0.0, description="reach of a correspondence in the last stage (m)"
    )
    robust_scale_start: float = Field(
        default=0.1,
        gt=0.0,
        description="scale of the Cauchy loss in the first stage (m); larger residuals weigh less",
    )
    robust_scale_end: float = Field(
        default=0.03, gt=0.0, description="scale of the Cauchy loss in the last stage (m)"
    )
    max_iterations: int = Field(default=30, ge=1, description="iterations of a stage, at most")
    tolerance: float = Field(
        default=1e-6,
        gt=0.0,
        description="a stage ends when fitness and inlier error change by less than this",
    )
    normal_neighbours: int = Field(
        default=5,
        ge=1,
        description="neighbours either side, in beam order, that a normal is fitted to",
    )
    normal_radius: float = Field(
        default=0.3, gt=0.0, description="neighbours further away than this are left out (m)"
    )

    @model_validator(mode="after")
    def _shrinking(self) -> IcpConfig:
        if self.distance_end > self.distance_start:
            raise ValueError("distance_end is larger than distance_start")
        if self.robust_scale_end > self.robust_scale_start:
            raise ValueError("robust_scale_end is larger than robust_scale_start")
        return self


class IcpReference(Reference):
    """A reference as an Open3D point cloud whose normals lie in the plane."""

    def __init__(self, points: Points, config: IcpConfig) -> None:
        super().__init__(points)
        normals = line_normals(points, config.normal_neighbours, config.normal_radius)
        self.cloud = point_cloud(points, normals)


class Icp(Matcher[IcpConfig]):
    """Point-to-line ICP with a Cauchy loss, from coarse to fine (Open3D's ``registration_icp``).

    Open3D does not tell its iterations, so ``evaluations`` is 0.
    """

    Config = IcpConfig
    summary = "point-to-line ICP, robust, coarse to fine (Open3D)"
    side_by_side = True

    @classmethod
    def check_available(cls) -> None:
        """Import Open3D, and say what is missing where that fails."""
        open3d()

    def prepare(self, points: Points) -> IcpReference:
        """Fit the reference's normals; see `hsslam.matching.Matcher.prepare`."""
        return IcpReference(clean(points), self.config)

    def estimate(
        self,
        reference: Reference,
        points: Points,
        guess: Pose,
        window: SearchWindow,
        rng: np.random.Generator,
    ) -> Estimate:
        """Start at the guess; converged where the last stage found correspondences for three points."""
        assert isinstance(reference, IcpReference)
        config, registration = self.config, open3d().pipelines.registration
        criteria = registration.ICPConvergenceCriteria(
            config.tolerance, config.tolerance, config.max_iterations
        )
        distances = np.geomspace(config.distance_start, config.distance_end, config.stages)
        scales = np.geomspace(config.robust_scale_start, config.robust_scale_end, config.stages)
        scan = point_cloud(points)
        matrix = transformation(guess)
        with one_thread():
            for distance, scale in zip(distances, scales, strict=True):
                loss = registration.TransformationEstimationPointToPlane(registration.CauchyLoss(k=scale))
                result = registration.registration_icp(
                    scan, reference.cloud, distance, matrix, loss, criteria
                )
                matrix = result.transformation
        matched = float(result.fitness)
        return Estimate(
            pose=window.keep(guess, planar_pose(matrix), config.window_slack),
            converged=matched * len(points) >= 3.0,
            diagnostics={"fitness": matched, "inlier_rmse": float(result.inlier_rmse)},
        )


def line_normals(points: Points, neighbours: int, radius: float) -> NDArray[np.float64]:
    """Fit a line around each point: unit normals, (N, 3) with z = 0; zero for a point with no neighbour.

    Open3D's own estimate would be the plane's normal for every point of a planar cloud: then no motion in
    the plane changes a point-to-plane distance, and the registration ends where it began.

    Parameters
    ----------
    points : Points
        (N, 2) m in beam order.
    neighbours : int
        Points either side, in that order, that may take part.
    radius : float
        Those further away than this (m) do not.
    """
    n = len(points)
    count, x, y, xx, xy, yy = np.zeros((6, n))
    reach = min(neighbours, n - 1)
    for step in range(-reach, reach + 1):
        here = slice(max(0, -step), min(n, n - step))
        there = slice(max(0, step), min(n, n + step))
        offset = points[there] - points[here]
        near = (offset * offset).sum(axis=1) <= radius * radius
        dx, dy = offset[:, 0] * near, offset[:, 1] * near
        count[here] += near
        x[here] += dx
        y[here] += dy
        xx[here] += dx * dx
        xy[here] += dx * dy
        yy[here] += dy * dy
    direction = 0.5 * np.arctan2(2.0 * (xy - x * y / count), (xx - x * x / count) - (yy - y * y / count))
    fitted = count > 1
    return np.column_stack((-np.sin(direction) * fitted, np.cos(direction) * fitted, np.zeros(n)))


def point_cloud(points: Points, normals: NDArray[np.float64] | None = None) -> Any:
    """Make an Open3D point cloud of (N, 2) points, z = 0."""
    o3d = open3d()
    cloud = o3d.geometry.PointCloud()
    cloud.points = o3d.utility.Vector3dVector(in_space(points))
    if normals is not None:
        cloud.normals = o3d.utility.Vector3dVector(normals)
    return cloud
