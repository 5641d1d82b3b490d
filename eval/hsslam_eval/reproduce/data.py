"""What the experiments run on: pairs of scans whose true relative pose is known."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hsslam.datasets.catalogue import open_dataset
from hsslam.datasets.dataset import Dataset
from hsslam.datasets.simulator import PLAN_NAMES, SimulatedDataset, laser_model
from hsslam.se2 import Points
from hsslam_eval.protocols import TrialPair, make_pairs
from hsslam_eval.reproduce.experiment import Request
from hsslam_eval.trial_config import TrialConfig

LASER = "urg-04lx"
"""The paper's robot carried one (section 6)."""

PLAN = "office"


@dataclass(frozen=True, eq=False)
class PairSet:
    """Pairs of one protocol, and what they are in words."""

    key: str
    label: str
    pairs: list[TrialPair]


def is_simulated(request: Request) -> bool:
    """Whether the experiments run on simulated scans."""
    return request.dataset is None or request.dataset in PLAN_NAMES


def open_data(request: Request, *, noiseless: bool = False, scans: int | None = None) -> Dataset:
    """Open the dataset that was asked for; simulated ones with the paper's laser; the first ``scans``."""
    if is_simulated(request):
        laser = laser_model(LASER)
        if noiseless:
            laser = replace(laser, range_noise=0.0, range_noise_share=0.0)
        return SimulatedDataset(request.dataset or PLAN, seed=request.seed, laser=laser, scans=scans)
    assert request.dataset is not None
    return open_dataset(request.dataset, data_dir=request.data_dir, seed=request.seed, scans=scans)


def trial_config(request: Request, count: int, side: float = 0.30, **given: Any) -> TrialConfig:
    """Trials with guesses off by up to half of ``side`` (the paper's L, m) and 10 degrees."""
    return TrialConfig(count=count, seed=request.seed, half_xy=side / 2.0, half_theta_deg=10.0, **given)


def pair_sets(request: Request, count: int, *, noiseless: bool = False) -> list[PairSet]:
    """Draw the pairs: scans of two places near by, and scans of a robot standing still, where both can be had.

    Parameters
    ----------
    request : Request
        Dataset and seed.
    count : int
        Pairs of each protocol, at most.
    noiseless : bool
        A simulated laser without range noise.
    """
    dataset = open_data(request, noiseless=noiseless)
    if is_simulated(request):
        plans: tuple[tuple[str, dict[str, Any]], ...] = (
            ("simulated", {"protocol": "simulated"}),
            (STILL, {"protocol": "simulated", "pair_distance": _NOTHING, "pair_angle_deg": _NOTHING}),
        )
    elif dataset.relations() is not None:
        plans = (("relations", {"protocol": "relations"}), ("static", {"protocol": "static"}))
    else:
        plans = (("", {}),)
    sets = []
    for key, given in plans:
        pairs = make_pairs(dataset, trial_config(request, count, **given))
        key = key or pairs[0].protocol
        sets.append(PairSet(key, f"{describe(request)}, {_TRUTH[key]}", pairs))
    return sets


STILL = "simulated-still"
"""Two simulated scans from one place: what ``static`` is for logs."""

_NOTHING = 1e-9

_TRUTH: dict[str, str] = {
    "simulated": "two places near by (truth exact)",
    STILL: "robot standing still (truth exact)",
    "relations": "two places near by (truth from official relations, good to about 1 cm)",
    "static": "robot standing still (truth zero)",
    "split": "even against odd beams (truth zero)",
    "consecutive": "truth from a given trajectory",
}


def describe(request: Request) -> str:
    """The data in a few words."""
    if is_simulated(request):
        return f"simulated URG-04LX in the {request.dataset or PLAN}"
    return str(request.dataset)


def attribution(request: Request) -> str:
    """What must be printed beside results."""
    return open_data(request).info.attribution


def add_noise(points: Points, deviation: float, rng: np.random.Generator) -> Points:
    """Move each return along its beam by Gaussian noise of ``deviation`` (m)."""
    ranges = np.hypot(points[:, 0], points[:, 1])
    scale = (ranges + deviation * rng.standard_normal(len(points))) / np.maximum(ranges, 1e-9)
    return np.asarray(points * scale[:, None])
