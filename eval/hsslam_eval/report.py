"""The report of a comparison: one self-contained HTML page and its Markdown and CSV twins."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from jinja2 import Environment, PackageLoader, StrictUndefined

from hsslam.io.atomic import atomic_path
from hsslam_eval.comparison import Comparison
from hsslam_eval.csv_files import write_csv_files
from hsslam_eval.figures import Picture, map_pictures, trajectory_pictures, trial_pictures
from hsslam_eval.tables import slam_tables, trial_tables, verdict


def write_report(comparison: Comparison, folder: Path | str) -> Path:
    """Write the report of a comparison into its folder.

    Makes ``report.html`` (nothing in it is loaded from elsewhere), ``report.md`` with ``figures/*.png``,
    ``trials.csv`` (a row per matcher), ``trials_raw.csv`` (a row per trial) and ``slam.csv``.

    Parameters
    ----------
    comparison : Comparison
        From `hsslam_eval.compare.compare`, or `Comparison.load`.
    folder : path
        Where to; maps are taken from the run folders in it.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    OSError
        A file cannot be written.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    content = _content(comparison, folder)
    pictures = [*content["trial_figures"], *content["trajectory_figures"], *content["map_figures"]]
    _write_pictures(pictures, folder / "figures")
    templates = Environment(
        loader=PackageLoader("hsslam_eval"),
        autoescape=lambda name: name is not None and ".html" in name,
        undefined=StrictUndefined,
        keep_trailing_newline=True,
    )
    # A heading may break between its words, not within its unit.
    templates.filters["tight"] = lambda text: re.sub(
        r"\([^)]*\)", lambda unit: unit[0].replace(" ", "\N{NO-BREAK SPACE}"), text
    )
    templates.filters["cell"] = lambda text: str(text).replace("|", r"\|").replace("\n", " ")
    for name in ("report.md", "report.html"):
        text = templates.get_template(f"{name}.j2").render(content)
        with atomic_path(folder / name) as temporary:
            temporary.write_text(text, encoding="utf-8")
    write_csv_files(comparison, folder)
    return folder / "report.html"


@dataclass(frozen=True)
class Problem:
    """Something that is missing from the report, and why."""

    label: str
    what: str
    reason: str
    remedy: str


def _content(comparison: Comparison, folder: Path) -> dict[str, Any]:
    dataset, environment = comparison.dataset, comparison.environment
    trials, slam = trial_tables(comparison), slam_tables(comparison)
    maps = map_pictures(comparison, folder)
    sections = [("trials", "Trials")] if trials else []
    sections += [("slam", "SLAM"), ("trajectories", "Trajectories")] if slam else []
    sections += [("maps", "Maps")] if maps else []
    return {
        "version": environment.get("hsslam", ""),
        "title": f"{dataset.name}: {_count(len(comparison.matchers), 'matcher')} compared",
        "subtitle": f"{_sentence(dataset.description)} Made by hsslam {environment.get('hsslam', '')}, "
        f"{comparison.created.replace('T', ' ')}.",
        "sections": [*sections, ("made", "How this was made")],
        "problems": _problems(comparison),
        "verdict": verdict(comparison),
        "trial_text": _trial_text(comparison),
        "trial_tables": trials,
        "trial_figures": trial_pictures(comparison),
        "slam_text": "The same settings for every matcher; it tracks every scan and, unless the settings name "
        "another, closes the loops.",
        "slam_tables": slam,
        "trajectory_figures": trajectory_pictures(comparison),
        "trajectory_text": _trajectory_text(comparison),
        "map_figures": maps,
        "map_text": "All at one scale. Black is occupied, white free, grey unknown.",
        "facts": _facts(comparison),
        "command": comparison.command,
        "config": yaml.safe_dump(comparison.config, sort_keys=False).rstrip(),
        "attribution": dataset.attribution,
    }


def _problems(comparison: Comparison) -> list[Problem]:
    what = {"unavailable": "unavailable here", "trials": "trials failed", "slam": "SLAM failed"}
    problems = []
    for matcher in comparison.matchers:
        for failure in matcher.failures:
            problems.append(Problem(matcher.label, what[failure.stage], failure.reason, failure.remedy))
        if matcher.slam is not None and matcher.slam.note:
            problems.append(Problem(matcher.label, "no map", matcher.slam.note, ""))
    return problems


def _trial_text(comparison: Comparison) -> str:
    done = next((matcher.trials for matcher in comparison.matchers if matcher.trials is not None), None)
    if done is None:
        return ""
    settings = comparison.config["trials"]
    first = done.successes[0]
    return (
        f"{done.count} trials, protocol {done.protocol} ({_PROTOCOLS.get(done.protocol, '')}). Each starts from the "
        f"true pose plus an error uniform in ±{100.0 * settings['half_xy']:.3g} cm and "
        f"±{settings['half_theta_deg']:.3g}°; pairs and errors are the same for every matcher. A success is nearer "
        f"the truth than {100.0 * first.displacement_limit_m:.3g} cm and {first.rotation_limit_deg:.3g}°"
        f"{'; the table has other definitions beside this one' if len(done.successes) > 1 else ''}."
    )


_PROTOCOLS = {
    "simulated": "pairs of simulated scans; truth is exact",
    "relations": "the two scans of a manually verified relation; truth is good to about 1 cm",
    "static": "two scans between which odometry did not move; truth is zero",
    "split": "even against odd beams of one scan; truth is zero",
    "consecutive": "scans a few steps apart with the relative pose of a given trajectory; truth has its noise",
}


def _trajectory_text(comparison: Comparison) -> str:
    kinds = {matcher.slam.reference_kind for matcher in comparison.matchers if matcher.slam is not None}
    if kinds == {"truth"}:
        return "Aligned with the true trajectory (least squares). All at one scale."
    return (
        "The log has no exact truth: odometry alone is shown for comparison, not as truth. All at one scale."
    )


def _facts(comparison: Comparison) -> list[tuple[str, str]]:
    dataset, environment = comparison.dataset, comparison.environment
    kind = {"simulated": f"simulated, seed {dataset.seed}", "real": "real log", "file": "log file"}
    packages = environment.get("packages", {})
    return [
        ("Dataset", f"{dataset.name} ({kind.get(dataset.kind, dataset.kind)}), {_scans(dataset.scans)}"),
        ("Seed", f"{comparison.config.get('seed', '')} (pairs, guesses, every matcher's random numbers)"),
        ("Processor", f"{environment.get('cpu', 'unknown')}, {environment.get('cores', '?')} cores usable"),
        ("System", f"{environment.get('system', '')} ({environment.get('machine', '')})"),
        ("Python", str(environment.get("python", ""))),
        ("hsslam", str(environment.get("hsslam", ""))),
        ("Packages", ", ".join(f"{name} {version}" for name, version in packages.items())),
    ]


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:].rstrip('.')}." if text else ""


def _scans(count: int | None) -> str:
    return "all scans" if count is None else _count(count, "scan")


def _count(number: int, thing: str) -> str:
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


def _write_pictures(pictures: list[Picture], folder: Path) -> None:
    folder.mkdir(exist_ok=True)
    for picture in pictures:
        with atomic_path(folder / f"{picture.key}.png") as temporary:
            temporary.write_bytes(picture.png)
