"""``hsslam compare``: several matchers on one dataset or more, and a report."""

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
from hsslam.cli.workers import Scheduler, check
from hsslam.cli.workers import Tell as TellWorkers
from hsslam.errors import ConfigError

if TYPE_CHECKING:
    from hsslam_eval.compare import CompareConfig
    from hsslam_eval.comparison import Comparison

_PAGE_ONLY = ("pairs", "slam-runs")
_STAGES = {
    "prepare": ("loading; compiling kernels on the first run", ""),
    "trials": ("trials", "trials"),
    "slam": ("SLAM", "scans"),
    "optimise": ("optimising the graph", ""),
    "map": ("drawing the map", ""),
}


_LISTS = {"--matchers": complete.several_matchers, "--datasets": complete.several_datasets}
_OPEN_LIST = "hsslam.open_list"


class ManyNames(TyperCommand):
    """Lets ``--matchers hsl hide icp`` take every name up to the next option; ``--datasets`` too."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Join the names that follow such an option with commas, at which it is split again."""
        joined: list[str] = []
        taking = False
        for arg in args:
            if arg.startswith("-"):
                taking = arg in _LISTS
                joined.append(arg)
            elif taking and joined[-1] not in _LISTS:
                joined[-1] += f",{arg}"
            else:
                joined.append(arg)
        ctx.meta[_OPEN_LIST] = next((a for a in reversed(args) if a.startswith("-")), "") if taking else ""
        return super().parse_args(ctx, joined)

    def shell_complete(self, ctx: Any, incomplete: str) -> list[Any]:
        """Offer the next name of a list where the dataset is there already and the parser sees only options."""
        option = ctx.meta.get(_OPEN_LIST)
        if option and not incomplete.startswith("-"):
            return next(p for p in self.params if option in p.opts).shell_complete(ctx, incomplete)
        return super().shell_complete(ctx, incomplete)


def _next_name(ctx: typer.Context, incomplete: str) -> list[str]:
    """Datasets, or the next name of a list that was begun: the parser takes it for the dataset's."""
    return _LISTS.get(ctx.meta.get(_OPEN_LIST, ""), complete.datasets)(incomplete)


def compare(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="DATASET",
            help="Names that `hsslam datasets` lists, or logs; office if left out.",
            autocompletion=_next_name,
        ),
    ] = None,
    dataset: Annotated[
        str | None,
        typer.Option(metavar="NAME|PATH", help="One, as an option.", autocompletion=complete.datasets),
    ] = None,
    datasets: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME|PATH...",
            help="Several, as an option: each has its part of the report.",
            autocompletion=complete.several_datasets,
        ),
    ] = None,
    matchers: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME...",
            help="Which, or `all`; the paper's three, icp and kiss_icp if left out.",
            autocompletion=complete.several_matchers,
        ),
    ] = None,
    trials: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Trials of each matcher and seed.")
    ] = None,
    seeds: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="N",
            help="Run everything with N seeds: --seed and the ones after it; 1 if left out.",
        ),
    ] = None,
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
    workers: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="N",
            help="Do N jobs side by side, in local processes; 1 if left out: times are comparable only so.",
        ),
    ] = None,
    scheduler: Scheduler = None,
    quiet: Quiet = False,
) -> None:
    """Compare matchers: trials, SLAM, and a report.

    Trials with known truth and SLAM with each matcher; tables here, and a report in HTML, Markdown and CSV.
    Given the folder of an earlier comparison, goes on with what is missing in it, also where more seeds, matchers or
    datasets are asked for than then.
    """
    from hsslam_eval.compare import DatasetSpec, Hands, compare_datasets, part_names
    from hsslam_eval.report import write_report

    check(scheduler, workers, data_dir)
    named = _datasets(list(dict.fromkeys(names or ())), dataset, split(datasets or ()))
    given = {
        "seed": seed,
        "seeds": seeds,
        "run_trials": False if no_trials else None,
        "run_slam": False if no_slam else None,
        "trials": _without_none({"count": trials, "protocol": protocol}),
        "limits": _without_none({"step": time_limit}),
    }
    resolved = resolve(config, split(matchers or ()), _without_none(given), settings or ())
    specs = [
        DatasetSpec(name=one, data_dir=data_dir, seed=resolved.seed, scans=scans, on_error=policy(on_error))
        for one in named
    ]
    infos = [spec.open().info for spec in specs]
    title = "+".join(info.name for info in infos)
    folder = out if out is not None else Path("runs") / f"{datetime.now():%Y%m%d-%H%M%S}-{title}-compare"
    command = shlex.join(["hsslam", *sys.argv[1:]])
    try:
        with progress(quiet) as shown:
            tell = Tell(shown, part_names(resolved, specs))
            hands = None
            if scheduler is not None or (workers or 1) > 1:
                hands = Hands(workers or 1, scheduler, TellWorkers(shown, "comparison"))
            study = compare_datasets(resolved, specs, folder, tell, command=command, hands=hands)
            shown.stage("writing the report")
            write_report(study, folder)
    except KeyboardInterrupt as error:
        again = command if out is not None else f"{command} --out {shlex.quote(str(folder))}"
        raise KeyboardInterrupt(f"what is done is kept; go on with: {again}") from error
    if not quiet:
        for comparison in study.comparisons:
            if len(specs) > 1:
                console.say(f"\n{comparison.dataset.name}")
            tables(comparison)
        console.say(f"\nreport: {folder / 'report.html'}")
        for attribution in dict.fromkeys(info.attribution for info in infos if info.attribution):
            console.say(f"\n{attribution}")


def _datasets(names: Sequence[str], dataset: str | None, datasets: Sequence[str]) -> list[str]:
    ways = [" ".join(names)] if names else []
    ways += [f"--dataset {dataset}"] if dataset else []
    ways += ["--datasets"] if datasets else []
    if len(ways) > 1:
        raise ConfigError(f"the dataset is named twice: {' and '.join(ways)}; name all after --datasets")
    return list(names or datasets) or [dataset or "office"]


class Tell:
    """Turns what `hsslam_eval.compare.compare_datasets` tells into stages of progress; takes its `part_names`."""

    def __init__(self, shown: Progress, parts: Sequence[str]) -> None:
        self._shown = shown
        self._parts = parts
        self._at = ("", "")

    def __call__(self, stage: str, part: str, done: int, total: int) -> None:
        """Take a step."""
        interrupt.check()
        if stage not in _STAGES:
            return
        what, unit = _STAGES[stage]
        if (stage, part) != self._at:
            self._at = (stage, part)
            place = f"[{self._parts.index(part) + 1}/{len(self._parts)}] {part}: {what}"
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
    from hsslam.config import apply_override, merge, validate
    from hsslam.matching import registry
    from hsslam.settings_file import read_yaml
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
            own = setting.partition("=")[0] in ("seed", "seeds", "run_trials", "run_slam")
            apply_override(data if own else slam, setting)
    return validate(
        CompareConfig,
        {**data, "matchers": listed, "slam": slam, "trials": trials, "limits": limits},
        source=str(file) if file is not None else "",
    )


def tables(comparison: Comparison) -> None:
    """Print the report's tables."""
    from hsslam_eval.report_text import problems
    from hsslam_eval.slam_tables import slam_tables
    from hsslam_eval.trial_tables import trial_tables, verdict

    # What the page has beyond these is too wide or too long for a terminal.
    shown = [t for t in (*trial_tables(comparison), *slam_tables(comparison)) if t.name not in _PAGE_ONLY]
    # A table tells of what is missing in it; where nothing was done there is none.
    for problem in [] if shown else problems(comparison):
        remedy = f"; to mend it: {problem.remedy}" if problem.remedy else ""
        console.say(f"{problem.label}: {problem.what}: {problem.reason}{remedy}")
    for table in shown:
        console.say(f"\n{table.title}")
        console.table(
            (table.corner, *table.headings),
            [
                (row.label, *(_cell(cell.text, cell.interval, cell.best) for cell in row.cells))
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


def _cell(text: str, interval: str, best: bool) -> str:
    text = f"{text} ★" if best else text
    return f"{text} ({interval})" if interval else text
