"""What others offer for the same job, each behind the same two functions: prepare a reference, match a scan.

Settings are the package's own where they suit indoor scans of 180 beams, and chosen by a few trials on other
pairs than the benchmark's where they do not; they are written out here. Every peer is kept to one thread.
"""

from __future__ import annotations

import contextlib
import io
import math
import random
from importlib import import_module
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from hsslam.kernels.surface import Surface
from hsslam.matching import Points, Pose, SearchWindow
from hsslam.search.fitness import HitFitness, build_raster


class Peer(Protocol):
    """A matcher of somebody else's; its constructor imports it, and raises ImportError where it is missing."""

    name: str
    package: str

    def prepare(self, points: Points) -> Any:
        """Make a reference of (N, 2) points."""

    def match(self, reference: Any, points: Points, guess: Pose, window: SearchWindow, seed: int) -> Pose:
        """Find the pose of (N, 2) points in the reference's frame."""


class Karto:
    """OpenKarto's correlative matcher: its grid is built for every match, so nothing can be prepared."""

    name, package = "Karto", "karto-scanmatcher"

    def __init__(self) -> None:
        self.library = import_module("karto_scanmatcher")
        self.matchers: dict[SearchWindow, Any] = {}

    def prepare(self, points: Points) -> Any:
        """Put the points back on beams."""
        return self._scan(points, np.zeros(3), 0)

    def match(self, reference: Any, points: Points, guess: Pose, window: SearchWindow, seed: int) -> Pose:
        """Search the window in steps of 1 cm; in heading of 1 degree, then 0.1. One matcher serves all matches."""
        if window not in self.matchers:
            self.matchers[window] = self._matcher(window)
        matcher, scan = self.matchers[window], self._scan(points, guess, 1)
        found = matcher.match_scan(scan, [reference], False, True).best_pose
        return np.array([found.x, found.y, found.yaw])

    def _matcher(self, window: SearchWindow) -> Any:
        config = self.library.ScanMatcherConfig()
        config.resolution = 0.01
        config.search_size = 2.0 * max(window.half_x, window.half_y)
        config.smear_deviation = 0.05
        config.coarse_search_angle_offset = window.half_theta
        config.coarse_angle_resolution = math.radians(1.0)
        config.fine_search_angle_resolution = math.radians(0.1)
        config.range_threshold = 30.0
        return self.library.Wrapper(config)

    def _scan(self, points: Points, pose: Pose, number: int) -> Any:
        angles = np.arctan2(points[:, 1], points[:, 0])
        steps = np.diff(np.sort(angles))
        step = float(steps[steps > 1e-4].min())
        ranges = np.full(int(2.0 * math.pi / step) + 2, 100.0)
        ranges[np.rint((angles + math.pi) / step).astype(int)] = np.hypot(points[:, 0], points[:, 1])
        laser = self.library.LaserScanConfig(-math.pi, math.pi, step, 0.0, 80.0, 60.0, "laser")
        where = [self.library.Pose2(*map(float, pose)) for _ in range(2)]
        return self.library.LocalizedRangeScan(laser, ranges.tolist(), *where, number, 0.0)


def layered(points: Points, heights: tuple[float, ...]) -> NDArray[np.float64]:
    """Copies of (N, 2) points at heights (m): what a 3D method takes for walls."""
    return np.vstack([np.column_stack((points, np.full(len(points), height))) for height in heights])


def matrix_of(pose: Pose) -> NDArray[np.float64]:
    """The (4, 4) matrix of a pose."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    out = np.eye(4)
    out[:2, :2] = (c, -s), (s, c)
    out[:2, 3] = pose[:2]
    return out


def pose_of(matrix: NDArray[np.float64]) -> Pose:
    """The pose of a (4, 4) matrix."""
    return np.array([matrix[0, 3], matrix[1, 3], math.atan2(matrix[1, 0], matrix[0, 0])])


class SmallGicp:
    """One run of small_gicp's GICP, points copied to z = -0.1, 0, 0.1."""

    name, package = "small_gicp GICP", "small_gicp"

    def __init__(self) -> None:
        self.library = import_module("small_gicp")

    def prepare(self, points: Points) -> Any:
        """Tree and covariances from ten neighbours."""
        cloud = self.library.PointCloud(layered(points, (-0.1, 0.0, 0.1)))
        tree = self.library.KdTree(cloud)
        self.library.estimate_covariances(cloud, tree, num_neighbors=10)
        return cloud, tree

    def match(self, reference: Any, points: Points, guess: Pose, window: SearchWindow, seed: int) -> Pose:
        """Correspondences up to half a metre."""
        cloud, _ = self.prepare(points)
        found = self.library.align(
            *(reference[0], cloud, reference[1]),
            init_T_target_source=matrix_of(guess),
            max_correspondence_distance=0.5,
            max_iterations=30,
        )
        return pose_of(found.T_target_source)


class Open3d:
    """One run of Open3D's point-to-plane ICP, normals in the plane from five beams either side."""

    name, package = "Open3D point-to-plane", "open3d"

    def __init__(self) -> None:
        from hsslam.errors import MatcherUnavailableError
        from hsslam_plugins.open3d_library import open3d

        try:
            self.library = open3d()
        except MatcherUnavailableError as error:
            raise ImportError(str(error)) from error

    def prepare(self, points: Points) -> Any:
        """Points and normals."""
        from hsslam_plugins.icp import line_normals, point_cloud

        return point_cloud(points, line_normals(points, 5, 0.3))

    def match(self, reference: Any, points: Points, guess: Pose, window: SearchWindow, seed: int) -> Pose:
        """Correspondences up to 30 cm."""
        from hsslam_plugins.icp import point_cloud
        from hsslam_plugins.open3d_library import one_thread

        registration = self.library.pipelines.registration
        with one_thread():
            found = registration.registration_icp(
                point_cloud(points),
                reference,
                0.3,
                matrix_of(guess),
                registration.TransformationEstimationPointToPlane(),
                registration.ICPConvergenceCriteria(1e-6, 1e-6, 30),
            )
        return pose_of(found.transformation)


class KissIcp:
    """One run of KISS-ICP's registration."""

    name, package = "KISS-ICP", "kiss-icp"

    def __init__(self) -> None:
        self.mapping = import_module("kiss_icp.mapping")
        self.registration = import_module("kiss_icp.registration").Registration(500, 1e-4, 1)

    def prepare(self, points: Points) -> Any:
        """Voxels of half a metre."""
        voxels = self.mapping.VoxelHashMap(0.5, 1e6, 100)
        voxels.add_points(layered(points, (0.0,)))
        return voxels

    def match(self, reference: Any, points: Points, guess: Pose, window: SearchWindow, seed: int) -> Pose:
        """Correspondences up to half a metre, scale of the kernel 5 cm."""
        scan = layered(points, (0.0,))
        return pose_of(self.registration.align_points_to_map(scan, reference, matrix_of(guess), 0.5, 0.05))


class SimpleIcp:
    """simpleicp, points copied to three heights, the three motions out of the plane held fixed."""

    name, package = "simpleicp", "simpleicp"
    heights = (-0.1, 0.0, 0.1)

    def __init__(self) -> None:
        self.library = import_module("simpleicp")

    def prepare(self, points: Points) -> NDArray[np.float64]:
        """Only copy the points: a run marks and moves points in the package's own clouds."""
        return layered(points, self.heights)

    def match(self, reference: Any, points: Points, guess: Pose, window: SearchWindow, seed: int) -> Pose:
        """Start at the guess; the package prints its iterations, which nobody reads here."""
        icp = self.library.SimpleICP()
        clouds = (reference, layered(points, self.heights))
        icp.add_point_clouds(*(self.library.PointCloud(cloud, columns=["x", "y", "z"]) for cloud in clouds))
        with contextlib.redirect_stdout(io.StringIO()):
            matrix, *_ = icp.run(
                correspondences=180,
                max_overlap_distance=0.5,
                max_iterations=30,
                rbp_observed_values=(0.0, 0.0, math.degrees(guess[2]), guess[0], guess[1], 0.0),
                rbp_observation_weights=(np.inf, np.inf, 0.0, 0.0, 0.0, np.inf),
            )
        return pose_of(np.asarray(matrix))


HALF_SIDE, CELL = 0.05, 0.01
"""Squares and cells (m) of the paper's fitness where a general optimiser searches it."""


def fitness_raster(points: Points) -> Any:
    """Rasterise a reference for the paper's fitness."""
    return build_raster("paper", points, Surface.build(points), HALF_SIDE, CELL)


class DifferentialEvolution:
    """scipy's differential evolution on the paper's fitness: 30 members, 20 generations."""

    name, package = "scipy DE, paper's fitness", "scipy"

    def __init__(self) -> None:
        self.search: Any = import_module("scipy.optimize").differential_evolution
        self.prepare = fitness_raster

    def match(self, reference: Any, points: Points, guess: Pose, window: SearchWindow, seed: int) -> Pose:
        """Search the window; the guess is one of the first members."""
        from hsslam.kernels.fitness import count_hits

        fitness = HitFitness.of(reference, points)
        cells, frame, xs, ys = fitness.cells, fitness.frame, fitness.xs, fitness.ys

        def cost(pose: Pose) -> int:
            return -count_hits(cells, frame, xs, ys, pose[0], pose[1], pose[2], 0)

        found = self.search(
            cost,
            list(zip(guess - window.half, guess + window.half, strict=True)),
            maxiter=20,
            popsize=10,
            tol=0.0,
            polish=False,
            x0=guess,
            rng=np.random.default_rng(seed),
        )
        pose: Pose = found.x
        return pose


class PyHarmonySearch:
    """pyHarmonySearch on the paper's fitness, with the paper's HMS, HMCR and NI and the middle of its PAR."""

    name, package = "pyHarmonySearch, paper's fitness", "pyHarmonySearch"

    def __init__(self) -> None:
        self.library = import_module("pyharmonysearch")
        self.prepare = fitness_raster

    def match(self, reference: Any, points: Points, guess: Pose, window: SearchWindow, seed: int) -> Pose:
        """Search the window; the guess is the first harmony."""
        from hsslam.kernels.fitness import count_hits

        fitness = HitFitness.of(reference, points)
        cells, frame, xs, ys = fitness.cells, fitness.frame, fitness.xs, fitness.ys
        low, high = guess - window.half, guess + window.half

        class Objective(self.library.ObjectiveFunctionInterface):  # type: ignore[name-defined, misc]
            def get_fitness(self, pose: Any) -> int:
                return count_hits(cells, frame, xs, ys, pose[0], pose[1], pose[2], 0)

            def get_value(self, axis: int, index: int | None = None) -> float:
                return random.uniform(low[axis], high[axis])

            def get_lower_bound(self, axis: int) -> float:
                return float(low[axis])

            def get_upper_bound(self, axis: int) -> float:
                return float(high[axis])

            def is_variable(self, axis: int) -> bool:
                return True

            def is_discrete(self, axis: int) -> bool:
                return False

            def get_num_parameters(self) -> int:
                return 3

            def use_random_seed(self) -> bool:
                return True

            def get_random_seed(self) -> int:
                return seed

            def get_max_imp(self) -> int:
                return 250

            def get_hmcr(self) -> float:
                return 0.88

            def get_par(self) -> float:
                return 0.75

            def get_hms(self) -> int:
                return 30

            def get_mpap(self) -> float:
                return 0.25

            def maximize(self) -> bool:
                return True

        random.seed(seed)
        first = [[random.uniform(*ends) for ends in zip(low, high, strict=True)] for _ in range(29)]
        best, *_ = self.library.HarmonySearch(Objective()).run([guess.tolist(), *first])
        return np.array(best)


PEERS: tuple[type[Peer], ...] = (
    SmallGicp,
    Open3d,
    KissIcp,
    Karto,
    SimpleIcp,
    DifferentialEvolution,
    PyHarmonySearch,
)
