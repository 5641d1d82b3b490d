"""What each preset changes: SLAM with the defaults and with the preset, on simulated lasers and places.

    python eval/benchmarks/presets.py [--seeds 3] [SETTING=VALUE,... ...]

Prints a row per laser and place: error against the exact truth (median over the seeds) and processor time, for the
defaults, the presets that fit, and any further settings given.
"""

from __future__ import annotations

import argparse
import math
import statistics
import time

import numpy as np

from hsslam.config import load_config
from hsslam.datasets.simulator import SimulatedDataset
from hsslam.datasets.simulator.floorplan import FloorPlan
from hsslam.datasets.simulator.laser import SICK_LMS200, URG_04LX, LaserModel
from hsslam.datasets.simulator.solids import box, pillar, room
from hsslam.slam.pipeline import Slam
from hsslam_eval.accuracy import measure

LASERS = {
    "sick-lms200": SICK_LMS200,
    # 30 mm at 10 m and 50 mm at 30 m are the makers' bounds; taken as two to three standard deviations.
    "hokuyo-utm30lx": LaserModel(
        "hokuyo-utm30lx",
        beams=1081,
        angle_min=math.radians(-135.0),
        angle_increment=math.radians(0.25),
        range_min=0.1,
        range_max=30.0,
        range_noise=0.01,
        range_noise_share=0.0015,
        resolution=0.001,
        drop_out=0.005,
    ),
    # Up to 2.5 % of the range, the makers' bound for far readings, taken as one standard deviation everywhere.
    "rplidar-a2": LaserModel(
        "rplidar-a2",
        beams=400,
        angle_min=-math.pi,
        angle_increment=2.0 * math.pi / 400,
        range_min=0.15,
        range_max=12.0,
        range_noise=0.005,
        range_noise_share=0.025,
        resolution=0.001,
        drop_out=0.02,
    ),
    "urg-04lx": URG_04LX,
}


def warehouse() -> FloorPlan:
    """A hall of 60 x 40 m with five rows of racks, and a round of 380 m through all its aisles."""
    racks = [box(x + 5.0, y + 2.0, 10.0, 1.2) for y in range(6, 36, 6) for x in (8, 20, 32, 44)]
    things = [
        box(2.5, 3.0, 1.2, 0.8),
        box(57.0, 37.0, 1.2, 1.0),
        box(40.0, 1.5, 2.0, 1.0),
        box(22.0, 38.5, 3.0, 0.8),
    ]
    pillars = [pillar(30.0, 2.0, 0.3), pillar(15.0, 38.0, 0.3), pillar(45.0, 38.0, 0.3)]
    aisles = [
        (x, y)
        for k, y in enumerate((4.5, 11.0, 17.0, 23.0, 29.0, 35.0))
        for x in ((4.5, 55.5), (55.5, 4.5))[k % 2]
    ]
    solids = (*room(0.0, 0.0, 60.0, 40.0), *racks, *things, *pillars)
    return FloorPlan("warehouse", "a simulated warehouse", solids, np.array(aisles))


def run(laser: str, place: str, seeds: int, presets: list[str], settings: list[str]) -> str:
    """One cell: the median error over the seeds and the time of all."""
    errors = []
    began = time.process_time()
    for seed in range(seeds):
        world = warehouse() if place == "warehouse" else place
        scans = 2600 if place == "warehouse" else None
        log = SimulatedDataset(world, seed=seed, scans=scans, laser=LASERS[laser])
        result = Slam(load_config(overrides=[f"seed={seed}", *settings], presets=presets)).solve(log.scans())
        errors.append(
            measure(result.trajectory, result.odometry, log.truth(), None)["ate"]["translation_rmse_m"]
        )
    seconds = (time.process_time() - began) / seeds
    return f"{statistics.median(errors):7.3f} m {seconds:6.1f} s"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("settings", nargs="*", help="further columns: settings with commas between them")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--lasers", default=",".join(LASERS))
    parser.add_argument("--places", default="office,hall,corridor,warehouse")
    arguments = parser.parse_args()
    run("sick-lms200", "hall", 1, [], ["keyframes.distance=1"])  # compiles
    for laser in arguments.lasers.split(","):
        for place in arguments.places.split(","):
            own = [laser] if place == "hall" else [laser, place]
            columns = [([], []), ([laser], []), (own, []), *(([], s.split(",")) for s in arguments.settings)]
            cells = [run(laser, place, arguments.seeds, presets, settings) for presets, settings in columns]
            print(f"{laser:15} {place:10}", " | ".join(cells), flush=True)


if __name__ == "__main__":
    main()
