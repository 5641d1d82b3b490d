"""Makes the pictures of the gallery by running hsslam over simulated worlds: python docs/make_gallery.py [FOLDER].

Pictures are drawn small and reduced to a palette, so that they can be kept with the documents.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from hsslam import Config, Slam, SlamResult, match, open_dataset
from hsslam.kernels.raster import Raster
from hsslam.kernels.surface import Surface
from hsslam.mapping.occupancy import build_grid
from hsslam.mapping.picture import write_map_png
from hsslam.scan import LaserScan
from hsslam.se2 import Points, Pose, between, transform
from hsslam.search.fitness import build_raster
from hsslam_eval.trajectory_metrics import ate

HERE = Path(__file__).parent / "gallery"
DPI = 80
WORLDS = {"office": 800, "corridor": 300, "hall": 700}
"""Simulated worlds, and how many scans of each."""


def solve(world: str) -> SlamResult:
    """Run SLAM over a world with the default matcher."""
    return Slam(Config()).solve(open_dataset(world, scans=WORLDS[world]).scans())


def draw_map(path: Path, world: str, result: SlamResult) -> None:
    """A map with the robot's way and its loops, as a run folder has it."""
    places = result.keyframe_poses
    ties = [(loop, (*places[loop.first, :2], *places[loop.second, :2])) for loop in result.loops]
    write_map_png(
        path,
        build_grid(result.keyframes, places),
        result.trajectory,
        [ends for loop, ends in ties if loop.accepted],
        f"{world}, {len(result.trajectory)} scans",
        refused=[ends for loop, ends in ties if loop.contested],
        dpi=DPI,
    )


def draw_odometry(path: Path, world: str, result: SlamResult) -> None:
    """What odometry alone makes of the same log."""
    scans = list(open_dataset(world, scans=WORLDS[world]).scans())
    at = [scan.index for scan in result.keyframes]
    grid = build_grid([scans[k] for k in at], result.odometry.poses[at])
    write_map_png(path, grid, result.odometry, title=f"{world}, odometry alone", dpi=DPI)


def draw_errors(path: Path, results: dict[str, SlamResult]) -> None:
    """Distance from the truth along each log, of SLAM and of odometry."""
    figure = Figure(figsize=(9, 3.2), layout="constrained")
    panels = figure.subplots(1, len(results), sharey=True, squeeze=False)[0]
    for axes, (world, result) in zip(panels, results.items(), strict=True):
        truth = open_dataset(world, scans=WORLDS[world]).truth()
        for name, trajectory in (("odometry", result.odometry), ("hsslam", result.trajectory)):
            errors = 100.0 * ate(trajectory, truth).translation
            axes.semilogy(truth.stamps, np.maximum(errors, 0.1), label=name, linewidth=1.2)
        axes.set(title=world, xlabel="time (s)")
        axes.grid(alpha=0.3)
    panels[0].set_ylabel("distance from the truth (cm)")
    panels[0].legend()
    save(figure, path)


def draw_match(path: Path) -> None:
    """Two scans before and after matching."""
    first, second, _ = pair()
    guess = between(first.odometry, second.odometry) + np.array([0.12, -0.1, 0.12])
    found = match(first, second, guess=guess).pose
    figure = Figure(figsize=(9, 4), layout="constrained")
    for axes, pose, title in zip(
        figure.subplots(1, 2, sharex=True, sharey=True), (guess, found), ("guess", "hide"), strict=True
    ):
        axes.plot(*first.robot_points.T, ".", markersize=3, color="#999999", label="reference")
        axes.plot(*transform(pose, second.robot_points).T, ".", markersize=3, color="#d55e00", label="scan")
        axes.set(title=title, aspect="equal", xlabel="x (m)")
    figure.axes[0].legend()
    save(figure, path)


def draw_fitness(path: Path) -> None:
    """The sum that population searches maximise, over shifts of a scan at its true heading, by fitness."""
    first, second, true = pair()
    reference = first.robot_points
    surface = Surface.build(reference)
    shifts = np.arange(-0.3, 0.3001, 0.0125)
    figure = Figure(figsize=(9, 3.4), layout="constrained")
    panels = figure.subplots(1, 3, sharey=True)
    for axes, name in zip(panels, ("paper", "surface", "likelihood"), strict=True):
        raster = build_raster(name, reference, surface, 0.05, 0.025)
        turned = transform(np.array([0.0, 0.0, true[2]]), second.robot_points)
        sums = [[worth(raster, turned + true[:2] + (x, y)) for x in shifts] for y in shifts]
        axes.imshow(sums, origin="lower", extent=(-0.3, 0.3, -0.3, 0.3), cmap="viridis")
        axes.plot(0, 0, "+", color="#d55e00")
        axes.set(title=name, xlabel="x (m)")
    panels[0].set_ylabel("y (m)")
    save(figure, path)


def pair() -> tuple[LaserScan, LaserScan, Pose]:
    """Two scans of the hall, and the true pose of the second seen from the first."""
    log = open_dataset("hall", scans=40)
    scans, truth = list(log.scans()), log.truth().poses
    return scans[10], scans[16], between(truth[10], truth[16])


def worth(raster: Raster, points: Points) -> int:
    """Sum of the cells that points fall into."""
    column, row = np.floor((points - raster.frame[:2]) * raster.frame[2]).astype(int).T
    rows, columns = raster.cells.shape
    inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    return int(raster.cells[row[inside], column[inside]].sum())


def save(figure: Figure, path: Path) -> None:
    """Write a figure as PNG."""
    FigureCanvasAgg(figure).print_png(path, metadata={"Software": None})


def shrink(path: Path) -> None:
    """Reduce a picture to 64 colours."""
    with Image.open(path) as picture:
        small = picture.convert("RGB").quantize(64, dither=Image.Dither.NONE)
    small.save(path, optimize=True)


def main(folder: Path = HERE) -> None:
    """Make every picture."""
    folder.mkdir(parents=True, exist_ok=True)
    results = {world: solve(world) for world in WORLDS}
    for world, result in results.items():
        draw_map(folder / f"{world}.png", world, result)
    draw_odometry(folder / "office-odometry.png", "office", results["office"])
    draw_errors(folder / "errors.png", results)
    draw_match(folder / "match.png")
    draw_fitness(folder / "fitness.png")
    for picture in sorted(folder.glob("*.png")):
        shrink(picture)
        print(f"{picture}: {picture.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
