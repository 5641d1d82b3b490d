"""``hsslam compare``: several matchers on one dataset, and a report."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand

from hsslam.cli import complete, console, interrupt
from hsslam.cli.options import DataDir, OnError, Plugin, Quiet, Scans, Seed, policy
from hsslam.cli.progress import Progress, progress
from hsslam.cli.settings import split
from hsslam.errors import ConfigError

if TYPE_CHECKING:
    from hsslam_eval.compare import CompareConfig
    from hsslam_eval.comparison import Comparison

_STAGES = {
    "prepare": ("loading; compiling kernels on the first run", ""),
    "trials": ("trials", "trials"),
    "slam": ("SLAM", "scans"),
    "optimise": ("optimising the graph", ""),
    "map": ("drawing the map", ""),
}


class ManyMatchers(TyperCommand):
    """Lets ``--matchers hsl hide icp`` take every name up to the next option."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Join the names that follow ``--matchers`` with commas, at which the option is split again."""
        joined: list[str] = []
        taking = False
        for arg in args:
            if arg.startswith("-"):
                taking = arg == "--matchers"
                joined.append(arg)
            elif taking and joined[-1] != "--matchers":
                joined[-1] += f",{arg}"
            else:
                joined.append(arg)
        return super().parse_args(ctx, joined)


def compare(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="[DATASET|PATH]",
            help="A name that `hsslam datasets` lists, or a log; office if left out.",
            autocompletion=complete.datasets,
        ),
    ] = None,
    dataset: Annotated[str | None, typer.Option(metavar="NAME|PATH", help="The same, as an option.")] = None,
    matchers: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME...",
            help="Which, or `all`; the paper's three, icp and kiss_icp if left out.",
            autocompletion=complete.matchers,
        ),
    ] = None,
    trials: Annotated[int | None, typer.Option(min=1, metavar="N", help="Trials of each matcher.")] = None,
    protocol: Annotated[
        str | None,
        typer.Option(
            metavar="P",
            help="Where the true poses of trials come from: simulated, relations, static, split, consecutive; "
            "what suits the dataset if left out.",
        ),
    ] = None,
    no_trials: Annotated[bool, typer.Option("--no-trials", help="Run SLAM only.")] = False,
    no_slam: Annotated[bool, typer.Option("--no-slam", help="Run trials only.")] = False,
    config: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="YAML with matchers, trials and slam; other options win over it."),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="A setting of SLAM (tracker.min_score=0.4), of trials (trials.half_xy=0.1) or of one matcher "
            "(hide.memory_size=40); may be repeated.",
        ),
    ] = None,
    time_limit: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            metavar="SECONDS",
            help="Give up a matcher's trials or SLAM run that takes no step for so long; 300 if left out, 0: never.",
        ),
    ] = None,
    plugin: Plugin = None,
    seed: Seed = None,
    scans: Scans = None,
    data_dir: DataDir = None,
    on_error: OnError = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="For the report and the runs; runs/<time>-<dataset>-compare if left out."
        ),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Compare matchers: trials, SLAM, and a report.

    Trials with known truth and SLAM with each matcher; tables here, and a report in HTML, Markdown and CSV.
    Given the folder of an earlier comparison, goes on with what is missing in it.
    """
    from hsslam_eval.compare import DatasetSpec
    from hsslam_eval.compare import compare as run_comparison
    from hsslam_eval.report import write_report

    if name is not None and dataset is not None:
        raise ConfigError(f"the dataset is named twice: {name} and --dataset {dataset}")
    given = {
        "seed": seed,
        "run_trials": False if no_trials else None,
        "run_slam": False if no_slam else None,
        "trials": _without_none({"count": trials, "protocol": protocol}),
        "limits": _without_none({"step": time_limit}),
    }
    resolved = resolve(config, split(matchers or ()), _without_none(given), settings or ())
    spec = DatasetSpec(
        name=name or dataset or "office",
        data_dir=data_dir,
        seed=resolved.seed,
        scans=scans,
        on_error=policy(on_error),
    )
    info = spec.open().info
    folder = out if out is not None else Path("runs") / f"{datetime.now():%Y%m%d-%H%M%S}-{info.name}-compare"
    command = shlex.join(["hsslam", *sys.argv[1:]])
    labels = [contestant.label for contestant in resolved.contestants]
    with progress(quiet) as shown:
        comparison = run_comparison(resolved, spec, folder, Tell(shown, labels), command=command)
        shown.stage("writing the report")
        write_report(comparison, folder)
    if not quiet:
        tables(comparison)
        console.say(f"\nreport: {folder / 'report.html'}")
        if info.attribution:
            console.say(f"\n{info.attribution}")


class Tell:
    """Turns what `hsslam_eval.compare.compare` tells into stages of progress."""

    def __init__(self, shown: Progress, labels: Sequence[str]) -> None:
        self._shown = shown
        self._labels = labels
        self._at = ("", "")

    def __call__(self, stage: str, matcher: str, done: int, total: int) -> None:
        """Take a step."""
        interrupt.check()
        if stage not in _STAGES:
            return
        what, unit = _STAGES[stage]
        if (stage, matcher) != self._at:
            self._at = (stage, matcher)
            place = f"[{self._labels.index(matcher) + 1}/{len(self._labels)}] {matcher}: {what}"
            self._shown.stage(place, total or None, unit)
        if unit:
            self._shown.update(done)


def resolve(
    file: Path | None, names: Sequence[str], given: dict[str, Any], settings: Sequence[str]
) -> CompareConfig:
    """Make the settings of a comparison: options win over the file, ``--set`` over both.

    Raises
    ------
    ConfigError
        As `hsslam.config.load_config` does.
    """
    from hsslam.config import apply_override, merge, read_yaml, validate
    from hsslam.matching import registry
    from hsslam_eval.compare_config import DEFAULT_MATCHERS, CompareConfig

    data = merge(read_yaml(file) if file is not None else {}, given)
    listed = [{"name": item} if isinstance(item, str) else dict(item) for item in data.get("matchers") or ()]
    if "all" in names:
        names = registry.names()
    if names:
        of_name = {item.get("label") or item.get("name"): item for item in listed}
        listed = [of_name.get(name, {"name": name}) for name in names]
    listed = listed or [{"name": name} for name in DEFAULT_MATCHERS]
    registry.quarantine(str(item.get("name")) for item in listed)
    contestants = {str(item.get("label") or item.get("name")): item for item in listed}
    slam = dict(data.get("slam") or {})
    trials = dict(data.get("trials") or {})
    limits = dict(data.get("limits") or {})
    for setting in settings:
        section, dot, rest = setting.partition(".")
        if section == "matcher" and dot:
            raise ConfigError(
                f"--set {setting}: compare has several matchers; set a parameter of one by its name, "
                f"e.g. {next(iter(contestants))}.{rest or 'score_distance=0.1'}"
            )
        sections = {"trials": trials, "slam": slam, "limits": limits, **contestants}
        if dot and section in sections:
            apply_override(sections[section], rest)
        else:
            own = setting.partition("=")[0] in ("seed", "run_trials", "run_slam")
            apply_override(data if own else slam, setting)
    return validate(
        CompareConfig,
        {**data, "matchers": listed, "slam": slam, "trials": trials, "limits": limits},
        source=str(file) if file is not None else "",
    )


def tables(comparison: Comparison) -> None:
    """Print the report's tables."""
    from hsslam_eval.tables import slam_tables, trial_tables, verdict

    for table in (*trial_tables(comparison), *slam_tables(comparison)):
        console.say(f"\n{table.title}")
        console.table(
            ("matcher", *table.headings),
            [
                (row.label, *(_cell(cell.text, cell.interval) for cell in row.cells))
                for row in table.rows
                if row.cells
            ],
        )
        for row in table.rows:
            if row.note:
                console.say(f"{row.label}: {row.note}")
    if said := verdict(comparison):
        console.say(f"\n{said}")


def _without_none(values: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in values.items() if value is not None}


def _cell(text: str, interval: str) -> str:
    return f"{text} ({interval})" if interval else text
