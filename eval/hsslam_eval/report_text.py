"""What a report says in words: on what terms was compared, what is missing, how it was made."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import yaml

from hsslam_eval.comparison import Comparison, Study
from hsslam_eval.tables import Cell, Row, Table, number

_PROTOCOLS = {
    "simulated": "pairs of simulated scans; truth is exact",
    "relations": "the two scans of a manually verified relation; truth is good to about 1 cm",
    "static": "two scans between which odometry did not move; truth is zero",
    "split": "even against odd beams of one scan; truth is zero",
    "consecutive": "scans a few steps apart with the relative pose of a given trajectory; truth has its noise",
}


@dataclass(frozen=True)
class Problem:
    """Something that is missing from the report, and why."""

    label: str
    what: str
    reason: str
    remedy: str


def problems(comparison: Comparison) -> list[Problem]:
    """Everything that failed, and maps that could not be drawn; one entry for seeds that failed alike."""
    what = {"unavailable": "unavailable here", "trials": "trials failed", "slam": "SLAM failed"}
    seeds = int(comparison.config.get("seeds", 1))
    found: dict[tuple[str, str, str, str], list[int]] = {}
    for matcher in comparison.matchers:
        for failure in matcher.failures:
            key = (matcher.label, what[failure.stage], failure.reason, failure.remedy)
            found.setdefault(key, []).extend([] if failure.seed is None else [failure.seed])
        for run in matcher.runs:
            if run.note:
                key = (matcher.label, "no map", run.note, "")
                found.setdefault(key, []).extend([] if run.seed is None else [run.seed])
    return [
        Problem(
            label,
            f"{kind} (seed {', '.join(map(str, of))})"
            if seeds > 1 and of and kind != what["unavailable"]
            else kind,
            reason,
            remedy,
        )
        for (label, kind, reason, remedy), of in found.items()
    ]


def equal_terms(study: Study) -> list[str]:
    """What was the same for every matcher, and what was not; a paragraph each."""
    first = study.comparisons[0]
    told = []
    if any(m.trials is not None for c in study.comparisons for m in c.matchers):
        settings = first.config["trials"]
        told.append(
            "Equal in the trials: the pairs of scans, the points made from them, the guesses, the window searched "
            f"(±{100.0 * settings['half_xy']:.3g} cm, ±{settings['half_theta_deg']:.3g}°), the clock ({_clock(study)}"
            "compiled and warmed up before it starts), and who judges: score, covariance and success are worked "
            "out by the framework, not by the matcher."
        )
    if any(m.runs for c in study.comparisons for m in c.matchers) and "slam" in first.config:
        told.append(
            "Equal in SLAM: the log, every setting of tracking, keyframes, loops and optimisation, and the pose graph. "
            "The matcher tracks every scan and, unless the settings name another, closes the loops."
        )
    several = len(study.comparisons) > 1
    if told:
        told.append(
            "Not equal: what a matcher does with its time. Each runs with its own settings, listed here; evaluations "
            "and time per match are reported beside every error."
        )
    for comparison in study.comparisons:
        told += [f"{comparison.dataset.name}: {note}" if several else note for note in comparison.notes]
    return told


def _clock(study: Study) -> str:
    """How many jobs the machine had at once while matches were timed."""
    most = max(comparison.hands for comparison in study.comparisons)
    if most > 1:
        return f"up to {most} processes at a time, so that times are those of a busy machine; "
    return "one process at a time, "


def _hands(study: Study) -> str:
    """How many jobs were done side by side, and where."""
    most = max(comparison.hands for comparison in study.comparisons)
    hosts = sorted({host for comparison in study.comparisons for host in comparison.hosts})
    if most == 1 and not hosts:
        return "one after the other"
    where = (
        f"; also on {', '.join(hosts)}, whose processors may be others: times are not comparable"
        if hosts
        else ""
    )
    return f"up to {most} side by side{where}"


def contestants_table(study: Study) -> Table | None:
    """Who competed, with what budget and settings; None where there is nothing to say of it."""
    rows: dict[str, Row] = {}
    for comparison in study.comparisons:
        for matcher in comparison.matchers:
            if not (matcher.parameters or matcher.runs):  # what could not run is told elsewhere
                continue
            spent = matcher.trials.evaluations_mean if matcher.trials is not None else 0.0
            given = ", ".join(f"{key} {value}" for key, value in matcher.parameters.items())
            given = given or "not known: a trajectory given as a file"
            rows.setdefault(
                matcher.label,
                Row(
                    matcher.label,
                    [
                        Cell(matcher.name),
                        Cell(number(spent or float("nan")).removesuffix(".0")),
                        Cell(given),
                    ],
                ),
            )
    if not rows:
        return None
    return Table(
        "contestants",
        "Who competed",
        "Every setting of each matcher, and the mean number of fitness evaluations or iterations of a trial; a dash "
        "where it does not count them, or where there were no trials.",
        ["matcher", "evaluations per match", "settings"],
        list(rows.values()),
        "name",
    )


def trial_text(comparison: Comparison) -> str:
    """What a trial is, and a success."""
    done = next((matcher.trials for matcher in comparison.matchers if matcher.trials is not None), None)
    if done is None:
        return ""
    config = comparison.config["trials"]
    first = done.successes[0]
    seeds = len(set(done.data.seed))
    return (
        f"{done.count} trials{f' ({seeds} seeds, each with pairs and guesses of its own)' if seeds > 1 else ''}, "
        f"protocol {done.protocol} ({_PROTOCOLS.get(done.protocol, '')}). Each starts from the "
        f"true pose plus an error uniform in ±{100.0 * config['half_xy']:.3g} cm and "
        f"±{config['half_theta_deg']:.3g}°; pairs and errors are the same for every matcher. A success is nearer "
        f"the truth than {100.0 * first.displacement_limit_m:.3g} cm and {first.rotation_limit_deg:.3g}°"
        f"{'; the table has other definitions beside this one' if len(done.successes) > 1 else ''}."
    )


def place_text(comparison: Comparison) -> str:
    """How trajectories and maps are drawn."""
    runs = [run for matcher in comparison.matchers for run in matcher.runs[:1]]
    drawn = "aligned with the true trajectory (least squares)"
    if {run.reference_kind for run in runs} != {"truth"}:
        drawn = "over odometry alone, which is shown for comparison, not as truth: the log has no exact truth"
    several = any(len(matcher.runs) > 1 for matcher in comparison.matchers)
    which = " Drawn is each matcher's first run." if several else ""
    return (
        f"Left, the trajectory {drawn}; black: loops accepted, dashed: loops tried and rejected. Right, the map in the "
        f"run's own frame: black is occupied, white free, grey unknown. All at one scale.{which}"
    )


def facts(study: Study) -> list[tuple[str, str]]:
    """Datasets, seeds, machine, versions."""
    first = study.comparisons[0]
    environment = first.environment
    packages = environment.get("packages", {})
    kinds = {"real": "real log", "file": "log file"}
    out = []
    for comparison in study.comparisons:
        dataset = comparison.dataset
        kind = kinds.get(dataset.kind, f"simulated, seed {dataset.seed} and on")
        out.append(("Dataset", f"{dataset.name} ({kind}), {_scans(dataset.scans)}"))
    if "seed" in first.config:
        seed, seeds = int(first.config["seed"]), int(first.config.get("seeds", 1))
        which = str(seed) if seeds == 1 else f"{seed} to {seed + seeds - 1}"
        out.append(("Seeds", f"{which} (pairs, guesses, every matcher's random numbers)"))
        out.append(("Jobs", _hands(study)))
    out += [
        ("Processor", f"{environment.get('cpu', 'unknown')}, {environment.get('cores', '?')} cores usable"),
        ("System", f"{environment.get('system', '')} ({environment.get('machine', '')})"),
        ("Python", str(environment.get("python", ""))),
        ("hsslam", str(environment.get("hsslam", ""))),
        ("Packages", ", ".join(f"{name} {version}" for name, version in packages.items())),
    ]
    return out


def settings(study: Study) -> str:
    """Every setting as YAML; empty where there are none."""
    config: dict[str, Any] = study.comparisons[0].config
    return yaml.safe_dump(config, sort_keys=False).rstrip() if config else ""


def sentence(text: str) -> str:
    """Begin with a capital letter and end in one full stop."""
    return f"{text[:1].upper()}{text[1:].rstrip('.')}." if text else ""


def count(number_of: int, thing: str) -> str:
    """A number of things."""
    return f"{number_of} {thing}" if number_of == 1 else f"{number_of} {thing}s"


def _scans(number_of: int | None) -> str:
    return "all scans" if number_of is None else count(number_of, "scan")
