"""Our matchers against what a user could install instead: same trials, one process, one thread, taking turns.

Preparing the reference and matching are timed apart. ``pip install 'hsslam[bench]'`` brings the peers; one that
is missing is a row that says so. Our rows include score and covariance in the time of a match, the peers' have
neither.
"""

from __future__ import annotations

import argparse
import json
import math
import os
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hsslam_eval.protocols import TrialPair
    from hsslam_eval.trials import TrialConfig, TrialOutcome, TrialResult

HEADER = (
    "matcher",
    "5 cm, 1 deg",
    "10 cm, 2 deg",
    "median cm",
    "median deg",
    "match ms",
    "prepare ms",
    "both ms",
    "ratio",
    "no answer",
)


def main() -> None:
    """Run the benchmark and print its table as Markdown."""
    arguments = _parse()
    _keep_to_one_thread()
    # Only now: libraries read how many threads they may use when they are imported.
    from hsslam.environment import environment

    config, results, missing = run(arguments)
    table = markdown(results, missing, config)
    title = (
        f"{arguments.dataset}: {len(next(iter(results.values())))} {config.protocol} trials, seed {config.seed}, "
        f"guesses within +-{config.half_xy:g} m and +-{config.half_theta_deg:g} degrees"
    )
    print(f"{title}\n\n{table}")
    if arguments.markdown is not None:
        _write(arguments.markdown, f"{title}\n\n{table}\n")
    if arguments.json is not None:
        record = {
            "dataset": str(arguments.dataset),
            "config": config.model_dump(mode="json"),
            "matchers": [result.summary().to_dict() for result in results.values()],
            "missing": missing,
            "environment": environment(),
        }
        _write(arguments.json, json.dumps(record, indent=2) + "\n")


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--dataset", default="office", help="name of a dataset, or path to a log")
    parser.add_argument("--data-dir", type=Path, help="folder of the real datasets")
    parser.add_argument("--matchers", nargs="*", help="of ours; all that are available")
    parser.add_argument("--peers", nargs="*", help="packages of the peers; all that are installed")
    parser.add_argument("--count", type=int, default=1000, help="trials")
    parser.add_argument("--protocol", default="auto", help="where the truth is from")
    parser.add_argument("--half-xy", type=float, default=0.15, help="error of the guess, half a side (m)")
    parser.add_argument("--half-theta-deg", type=float, default=10.0, help="and in heading (deg)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--markdown", type=Path, help="write the table to this file as well")
    parser.add_argument("--json", type=Path, help="write every figure to this file as well")
    return parser.parse_args()


def _keep_to_one_thread() -> None:
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ[variable] = "1"
    if hasattr(os, "sched_setaffinity"):  # Linux only; holds libraries that heed no variable
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def run(arguments: argparse.Namespace) -> tuple[TrialConfig, dict[str, TrialResult], dict[str, str]]:
    """Run every trial by every matcher before the next trial begins, each beginning in its turn.

    Returns
    -------
    TrialConfig, dict of TrialResult, dict of str
        The latter two by row: the figures, and why there are none.
    """
    from hsslam.config import validate
    from hsslam.datasets.catalogue import open_dataset
    from hsslam_eval.trials import TrialConfig, TrialResult, make_pairs

    wanted = ("count", "protocol", "half_xy", "half_theta_deg", "seed")
    config = validate(TrialConfig, {name: getattr(arguments, name) for name in wanted})
    dataset = open_dataset(arguments.dataset, data_dir=arguments.data_dir, seed=config.seed)
    pairs = make_pairs(dataset, config)
    config = config.model_copy(update={"protocol": pairs[0].protocol})
    ours, missing = _ours(arguments.matchers)
    peers, missing_peers = _peers(arguments.peers)
    contestants = {**ours, **peers}
    for one_trial in contestants.values():
        for trial in range(config.warm_up):
            one_trial(pairs[trial % len(pairs)], config, trial)
    outcomes: dict[str, list[TrialOutcome]] = {name: [] for name in contestants}
    names = list(contestants)
    for trial, pair in enumerate(pairs):
        begin = trial % len(names)
        for name in names[begin:] + names[:begin]:
            outcomes[name].append(contestants[name](pair, config, trial))
    results = {
        name: TrialResult.gather(name, pairs[0].protocol, config, found) for name, found in outcomes.items()
    }
    return config, results, {**missing, **missing_peers}


def _ours(wanted: list[str] | None) -> tuple[dict[str, Any], dict[str, str]]:
    from hsslam.errors import MatcherUnavailableError
    from hsslam.matching import create, names
    from hsslam_eval.trials import run_trial

    found: dict[str, Any] = {}
    missing = {}
    for name in names() if wanted is None else wanted:
        try:
            matcher = create(name)
        except MatcherUnavailableError as error:
            missing[name] = str(error)
            continue

        def one_trial(
            pair: TrialPair, config: TrialConfig, trial: int, matcher: Any = matcher
        ) -> TrialOutcome:
            return run_trial(matcher, pair, config, trial)

        found[name] = one_trial
    return found, missing


def _peers(wanted: list[str] | None) -> tuple[dict[str, Any], dict[str, str]]:
    from peer_adapters import PEERS

    found: dict[str, Any] = {}
    missing = {}
    for kind in PEERS:
        if wanted is not None and kind.package not in wanted:
            continue
        row = f"{kind.name} (peer)"
        try:
            peer = kind()
        except ImportError as error:
            missing[row] = f"not installed: {error}"
            continue

        def one_trial(pair: TrialPair, config: TrialConfig, trial: int, peer: Any = peer) -> TrialOutcome:
            return peer_trial(peer, pair, config, trial)

        found[row] = one_trial
    return found, missing


def peer_trial(peer: Any, pair: TrialPair, config: TrialConfig, trial: int) -> TrialOutcome:
    """`hsslam_eval.trials.run_trial` for a peer, which has no score and rejects nothing."""
    import numpy as np

    from hsslam.se2 import between
    from hsslam_eval.trials import TrialOutcome, trial_guess

    guess = trial_guess(pair.truth, config, trial)
    off = between(pair.truth, guess)
    prepare_seconds = seconds = float("nan")
    error, failure = off, ""
    try:
        start = perf_counter()
        reference = peer.prepare(pair.reference_points)
        prepare_seconds = perf_counter() - start
        start = perf_counter()
        found = peer.match(reference, pair.scan_points, guess, config.window, config.seed + trial)
        seconds = perf_counter() - start
        error = between(pair.truth, np.asarray(found, dtype=np.float64))
    except Exception as problem:  # a peer may fail in any way; it costs this trial only
        failure = f"{type(problem).__name__}: {problem}"
    return TrialOutcome(
        displacement=float(np.hypot(error[0], error[1])),
        rotation=abs(float(error[2])),
        initial_displacement=float(np.hypot(off[0], off[1])),
        initial_rotation=abs(float(off[2])),
        seconds=seconds,
        prepare_seconds=prepare_seconds,
        evaluations=0,
        score=0.0,
        converged=not failure,
        failure=failure,
    )


def markdown(results: dict[str, TrialResult], missing: dict[str, str], config: TrialConfig) -> str:
    """Table of all rows, those with most successes first; ratios of both times to those of ``hide``."""
    import numpy as np

    tight, loose = (
        next(limit for limit in config.thresholds if limit.name == name) for name in ("5cm_1deg", "10cm_2deg")
    )
    times = {}
    for name, result in results.items():
        ran = np.isfinite(result.seconds)
        clocks = (result.seconds, result.prepare_seconds, result.seconds + result.prepare_seconds)
        times[name] = [1e3 * float(np.median(clock[ran])) if ran.any() else math.nan for clock in clocks]
    yardstick = times.get("hide", next(iter(times.values())))[2]
    order = sorted(
        results, key=lambda name: (-results[name].success(tight).sum(), -results[name].success(loose).sum())
    )
    lines = ["| " + " | ".join(HEADER) + " |", "|" + " --- |" * len(HEADER)]
    for name in order:
        result = results[name]
        good = result.success(tight)
        match, prepare, total = times[name]
        cells = (
            name,
            f"{good.mean():.3f}",
            f"{result.success(loose).mean():.3f}",
            f"{100.0 * np.median(result.displacement[good]):.2f}" if good.any() else "-",
            f"{np.degrees(np.median(result.rotation[good])):.3f}" if good.any() else "-",
            f"{match:.3f}",
            f"{prepare:.3f}",
            f"{total:.3f}",
            f"{total / yardstick:.1f}",
            str(int((~result.answered).sum())),
        )
        lines.append("| " + " | ".join(cells) + " |")
    lines += [f"| {name} | {reason} |" + " |" * (len(HEADER) - 2) for name, reason in missing.items()]
    return "\n".join(lines)


def _write(path: Path, text: str) -> None:
    from hsslam.io.atomic import atomic_path

    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
