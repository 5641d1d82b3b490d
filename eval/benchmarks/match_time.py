"""Time per match of several matchers on the same trials: one process, one thread, taking turns.

Every trial is run by each matcher before the next trial begins, and each matcher begins in its turn, so that
cold caches and whatever else the machine does fall on all of them alike. Preparing the reference and matching
are timed apart; warm-up calls are not counted.
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hsslam_eval.trials import TrialConfig, TrialResult

MATCHERS = ["hsl", "hide", "glasm", "icp", "kiss_icp"]


def main() -> None:
    """Run the benchmark and print its table."""
    arguments = _parse()
    _keep_to_one_thread()
    # Only now: libraries read how many threads they may use when they are imported.
    from hsslam.environment import environment

    config, results, unavailable = _run(arguments)
    print(f"{arguments.dataset}: {len(results[0])} {results[0].protocol} trials, seed {config.seed}, "
          f"guesses within +-{config.half_xy:g} m and +-{config.half_theta_deg:g} degrees")  # fmt: skip
    print(_table(results, config))
    for name, reason in unavailable.items():
        print(f"{name}: left out, {reason}")
    if arguments.json is not None:
        _write(arguments, config, results, unavailable, environment())


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--dataset", default="office", help="name of a dataset, or path to a log")
    parser.add_argument("--data-dir", type=Path, help="folder of the real datasets")
    parser.add_argument("--matchers", nargs="+", default=MATCHERS, help="ratios are to the first")
    parser.add_argument("--count", type=int, default=300, help="trials")
    parser.add_argument("--protocol", default="auto", help="where the truth is from")
    parser.add_argument("--half-xy", type=float, default=0.15, help="error of the guess, half a side (m)")
    parser.add_argument("--half-theta-deg", type=float, default=10.0, help="and in heading (deg)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path, help="write the figures to this file as well")
    return parser.parse_args()


def _keep_to_one_thread() -> None:
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ[variable] = "1"
    if hasattr(os, "sched_setaffinity"):  # Linux only; holds libraries that heed no variable
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def _run(arguments: argparse.Namespace) -> tuple[TrialConfig, list[TrialResult], dict[str, str]]:
    from hsslam.config import validate
    from hsslam.datasets.catalogue import open_dataset
    from hsslam.errors import MatcherUnavailableError
    from hsslam.matching import create
    from hsslam_eval.trials import TrialConfig, TrialResult, make_pairs, run_trial, warm_up

    wanted = ("count", "protocol", "half_xy", "half_theta_deg", "seed")
    config = validate(TrialConfig, {name: getattr(arguments, name) for name in wanted})
    matchers, unavailable = {}, {}
    for name in arguments.matchers:
        try:
            matchers[name] = create(name)
        except MatcherUnavailableError as error:
            unavailable[name] = str(error)
    if not matchers:
        raise SystemExit("\n".join(unavailable.values()))
    dataset = open_dataset(arguments.dataset, data_dir=arguments.data_dir, seed=config.seed)
    pairs = make_pairs(dataset, config)
    for matcher in matchers.values():
        warm_up(matcher, pairs, config)
    outcomes: dict[str, list[Any]] = {name: [] for name in matchers}
    for trial, pair in enumerate(pairs):
        names = list(matchers)
        begin = trial % len(names)
        for name in names[begin:] + names[:begin]:
            outcomes[name].append(run_trial(matchers[name], pair, config, trial))
    protocol = pairs[0].protocol
    results = [TrialResult.gather(name, protocol, config, found) for name, found in outcomes.items()]
    return config, results, unavailable


def _table(results: list[TrialResult], config: TrialConfig) -> str:
    summaries = [result.summary() for result in results]
    first = summaries[0].match_seconds_median
    limits = [threshold.name for threshold in config.thresholds]
    rows = [
        [
            "matcher",
            "match ms",
            f"/ {summaries[0].matcher}",
            "prepare ms",
            "evaluations",
            *limits,
            "no answer",
        ]
    ]
    for summary in summaries:
        rows.append(
            [
                summary.matcher,
                f"{summary.match_seconds_median * 1e3:.3f}",
                f"{summary.match_seconds_median / first:.2f}",
                f"{summary.prepare_seconds_median * 1e3:.3f}",
                f"{summary.evaluations_mean:.0f}",
                *(f"{summary.success[name].ratio.value:.3f}" for name in limits),
                str(sum(summary.failures.values())),
            ]
        )
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join(
        "  ".join(
            cell.rjust(width) if column else cell.ljust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    )


def _write(
    arguments: argparse.Namespace,
    config: TrialConfig,
    results: list[TrialResult],
    unavailable: dict[str, str],
    environment: dict[str, Any],
) -> None:
    from hsslam.io.atomic import atomic_path

    record = {
        "dataset": str(arguments.dataset),
        "config": config.model_dump(mode="json"),
        "matchers": [result.summary().to_dict() for result in results],
        "unavailable": unavailable,
        "environment": environment,
    }
    with atomic_path(arguments.json) as temporary:
        temporary.write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
