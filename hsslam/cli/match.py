"""``hsslam match``: two scans, one pose."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hsslam.cli import console
from hsslam.cli.options import (
    AsJson,
    DataDir,
    MatcherName,
    OdomTopic,
    Plugin,
    Quiet,
    ScanTopic,
    Seed,
    Settings,
)
from hsslam.cli.progress import progress
from hsslam.errors import ConfigError, DataError

if TYPE_CHECKING:
    from hsslam.matching import MatchResult, Points, Pose
    from hsslam.scan import LaserScan


def match(
    what: Annotated[
        list[str],
        typer.Argument(
            metavar="DATASET A B | FILE FILE",
            help="A dataset or log and the numbers of two scans, or two files of points (csv, xyz, npy).",
        ),
    ],
    matcher: MatcherName = None,
    plugin: Plugin = None,
    guess: Annotated[
        str,
        typer.Option(
            metavar="X,Y,DEG",
            help="Where B is thought to be, seen from A (m, m, deg); or: odometry. Files: 0,0,0.",
        ),
    ] = "odometry",
    window: Annotated[
        str,
        typer.Option(
            metavar="X,Y,DEG", help="How far from the guess the truth may be: half sides (m, m, deg)."
        ),
    ] = "0.3,0.3,15",
    settings: Settings = None,
    seed: Seed = None,
    data_dir: DataDir = None,
    scan_topic: ScanTopic = None,
    odom_topic: OdomTopic = None,
    picture: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="The picture; match.png (or match-2.png...) if left out."),
    ] = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Match two scans of a log or two point files.

    Prints the pose of the second seen from the first, its covariance and score, and draws a picture.
    """
    import time

    import numpy as np

    from hsslam.cli.picture import free_name, write_match_picture
    from hsslam.cli.progress import watch_compiler
    from hsslam.cli.settings import resolve
    from hsslam.matching import SearchWindow

    half_x, half_y, half_theta = numbers(window, "--window")
    if min(half_x, half_y, half_theta) <= 0.0:
        raise ConfigError(f"--window: expected three positive numbers, found {window!r}")
    config = resolve(matcher=matcher, seed=seed, settings=settings or ())
    method = config.matcher.create()
    if scan_topic or odom_topic:
        from hsslam.datasets.catalogue import join_source

        what = [join_source(what[0], scan_topic=scan_topic, odom_topic=odom_topic), *what[1:]]
    reference, points, odometry = _points(what, config.seed, data_dir)
    start = odometry
    if guess != "odometry":
        x, y, degrees = numbers(guess, "--guess")
        start = np.array([x, y, np.radians(degrees)])
    with progress(quiet or as_json) as shown, watch_compiler(shown):
        shown.stage(f"matching with {config.matcher.name}")
        prepared = method.prepare(reference)
        box = SearchWindow(half_x, half_y, float(np.radians(half_theta)))
        rounds = []
        for _ in range(2):  # the first one may have compiled or loaded kernels: its time tells nothing
            began = time.perf_counter()
            result = method.match(prepared, points, start, box, np.random.default_rng(config.seed))
            rounds.append(time.perf_counter() - began)
    drawn = free_name(Path("match.png")) if picture is None else picture
    title = f"{config.matcher.name}: {' '.join(what)}, score {result.score:.2f}"
    write_match_picture(drawn, reference, points, start, result.pose, title)
    if as_json:
        console.print_json(_json(config.matcher.name, config.seed, start, result, rounds[-1], drawn))
        return
    console.pairs(_rows(config.matcher.name, start, result, rounds[-1], drawn))


def numbers(text: str, option: str) -> tuple[float, float, float]:
    """Three numbers with commas between them.

    Raises
    ------
    ConfigError
        It is something else.
    """
    import math

    try:
        x, y, theta = (float(part) for part in text.split(","))
    except ValueError:
        raise ConfigError(f"{option}: expected x,y,degrees, e.g. 0.3,0.3,15, found {text!r}") from None
    if not all(math.isfinite(value) for value in (x, y, theta)):
        raise ConfigError(f"{option}: expected finite numbers, found {text!r}")
    return x, y, theta


def _points(what: list[str], seed: int, data_dir: Path | None) -> tuple[Points, Points, Pose]:
    """Both sets of points, and what odometry says of the second's pose."""
    import numpy as np

    from hsslam.io.points import read_points
    from hsslam.se2 import between

    if len(what) == 2 and not what[1].isdigit():
        return read_points(what[0]), read_points(what[1]), np.zeros(3)
    if len(what) != 3 or not all(part.isdigit() for part in what[1:]):
        raise ConfigError(
            "match takes a dataset and two scans' numbers (hsslam match intel 100 120) or two point files "
            f"(hsslam match a.csv b.csv), found {' '.join(what)!r}"
        )
    first, second = _scans(what[0], int(what[1]), int(what[2]), seed, data_dir)
    return first.robot_points, second.robot_points, between(first.odometry, second.odometry)


def _scans(
    source: str, first: int, second: int, seed: int, data_dir: Path | None
) -> tuple[LaserScan, LaserScan]:
    from itertools import islice

    from hsslam.datasets.catalogue import open_dataset

    log = open_dataset(source, data_dir=data_dir, seed=seed)
    found: dict[int, LaserScan] = {}
    read = 0
    for read, scan in enumerate(islice(log.scans(), max(first, second) + 1), start=1):
        if read - 1 in (first, second):
            found[read - 1] = scan
    if len({first, second} - set(found)):
        raise DataError(
            f"{source}: has {read:,} scans, numbered from 0; there is no scan {max(first, second)}"
        )
    return found[first], found[second]


def _rows(
    name: str, guess: Pose, result: MatchResult, seconds: float, picture: Path
) -> list[tuple[str, object]]:
    import numpy as np

    std = np.sqrt(np.diag(result.covariance))
    rejected = result.diagnostics.get("rejected")
    return [
        ("matcher", name),
        ("guess", f"{guess[0]:.4f} m, {guess[1]:.4f} m, {np.degrees(guess[2]):.3f} deg"),
        ("pose", f"{result.pose[0]:.4f} m, {result.pose[1]:.4f} m, {np.degrees(result.pose[2]):.3f} deg"),
        ("std", f"{std[0]:.4f} m, {std[1]:.4f} m, {np.degrees(std[2]):.3f} deg"),
        *(
            ("covariance" if row == 0 else "", "  ".join(f"{value: .3e}" for value in values))
            for row, values in enumerate(result.covariance)
        ),
        ("score", f"{result.score:.3f}"),
        ("converged", "yes" if result.converged else f"no{f': {rejected}' if rejected else ''}"),
        ("evaluations", f"{result.evaluations:,}"),
        ("time", f"{seconds * 1e3:.2f} ms"),
        ("picture", picture),
    ]


def _json(
    name: str, seed: int, guess: Pose, result: MatchResult, seconds: float, picture: Path
) -> dict[str, Any]:
    return {
        "matcher": name,
        "seed": seed,
        "units": "m, m, rad",
        "guess": guess.tolist(),
        "pose": result.pose.tolist(),
        "covariance": result.covariance.tolist(),
        "score": result.score,
        "converged": result.converged,
        "evaluations": result.evaluations,
        "diagnostics": dict(result.diagnostics),
        "seconds": seconds,
        "picture": str(picture),
    }
