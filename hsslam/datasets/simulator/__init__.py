"""A simulator: floor plans, lasers, a robot and its odometry, with the exact truth."""

from hsslam.datasets.simulator.dataset import DEFAULT_SCANS, SimulatedDataset
from hsslam.datasets.simulator.floorplan import FloorPlan
from hsslam.datasets.simulator.laser import LASERS, LaserModel, laser_model
from hsslam.datasets.simulator.odometry import EXACT, OdometryModel
from hsslam.datasets.simulator.pairs import SimulatedPair, simulate_pairs
from hsslam.datasets.simulator.path import DriveModel, drive
from hsslam.datasets.simulator.plans import PLAN_NAMES, floor_plan
from hsslam.datasets.simulator.raycast import raycast

__all__ = [
    "DEFAULT_SCANS",
    "EXACT",
    "LASERS",
    "PLAN_NAMES",
    "DriveModel",
    "FloorPlan",
    "LaserModel",
    "OdometryModel",
    "SimulatedDataset",
    "SimulatedPair",
    "drive",
    "floor_plan",
    "laser_model",
    "raycast",
    "simulate_pairs",
]
