"""``hsslam run``: SLAM over a log; leaves a run folder."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hsslam.cli import complete, console
from hsslam.cli.options import (
    ConfigFile,
    DataDir,
    MatcherName,
    OdomTopic,
    OnError,
    Plugin,
    Presets,
    Quiet,
    Scans,
    ScanTopic,
    Seed,
    Settings,
    policy,
)
from hsslam.cli.progress import progress
from hsslam.cli.settings import resolve
from hsslam.errors import ConfigError

if TYPE_CHECKING:
    from hsslam.slam.journal import Header


def run(
    dataset: Annotated[
        str | None,
        typer.Argument(
            metavar="DATASET|PATH",
            help="A name that `hsslam datasets` lists, or a log.",
            autocompletion=complete.datasets,
        ),
    ] = None,
    matcher: MatcherName = None,
    loop_matcher: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Another matcher for closing loops.",
            autocompletion=complete.matchers,
        ),
    ] = None,
    preset: Presets = None,
    config: ConfigFile = None,
    settings: Settings = None,
    seed: Seed = None,
    refine: Annotated[
        int | None,
        typer.Option(
            metavar="ROUNDS",
            min=0,
            help="Match overlapping keyframes again from the optimised poses, up to so often; one if left out.",
        ),
    ] = None,
    scans: Scans = None,
    scan_topic: ScanTopic = None,
    odom_topic: OdomTopic = None,
    data_dir: DataDir = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="The run folder; runs/<time>-<dataset>-<matcher> if left out."),
    ] = None,
    resume: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Go on with the run that died in this folder.")
    ] = None,
    live: Annotated[bool, typer.Option("--live", help="Show the map while it grows.")] = False,
    viewer: Annotated[
        str | None,
        typer.Option(
            metavar="auto|rerun|matplotlib",
            help="What --live shows it with; auto: rerun if it is installed, else a window of matplotlib. Without a "
            "display rerun records to live.rrd in the run folder.",
            autocompletion=complete.viewers,
        ),
    ] = None,
    profile: Annotated[
        bool, typer.Option("--profile", help="Say at the end where the time went, stage by stage.")
    ] = False,
    quiet: Quiet = False,
    on_error: OnError = None,
    plugin: Plugin = None,
) -> None:
    """Run SLAM over a log; leaves a run folder.

    In it: trajectories (TUM), the pose graph (g2o), the map (ROS), metrics, timings, the resolved settings.
    Its files open in the usual tools.
    """
    from hsslam.cli.running import profile as stages
    from hsslam.cli.running import run_log, summary
    from hsslam.datasets.catalogue import open_dataset
    from hsslam.datasets.usable import require_returns
    from hsslam.live.viewers import AUTO, require_viewer
    from hsslam.slam.folder import RunFolder
    from hsslam.slam.journal import Header

    if viewer is not None and not live:
        raise ConfigError("--viewer says what --live shows the map with; give --live too")
    if resume is not None and out is not None:
        raise ConfigError("--resume goes on in its own folder; leave out --out")
    folder = RunFolder.resume(resume) if resume is not None else None
    died = folder.replay.header if folder is not None and folder.replay is not None else None
    resolved = resolve(
        file=config,
        matcher=matcher,
        loop_matcher=loop_matcher,
        seed=seed,
        presets=preset or (),
        settings=[*(settings or ()), *([] if refine is None else [f"graph.refine_rounds={refine}"])],
        base=died.config if died is not None else None,
    )
    topics = {"scan_topic": scan_topic, "odom_topic": odom_topic}
    header = Header(_source(dataset, topics, scans, on_error, died), resolved.model_dump(mode="json"))
    if died is not None:
        header.check_same(died, f"{resume}")
    log = open_dataset(
        header.dataset["source"],
        data_dir=data_dir,
        seed=resolved.seed,
        scans=header.dataset["scans"],
        on_error=policy(header.dataset["on_error"]),
    )
    # What cannot be run is found before a folder is made.
    if live:
        require_viewer(viewer or AUTO)
    resolved.matcher.create()
    if folder is None:
        require_returns(log)
        folder = RunFolder.create(out, log.info.name, resolved.matcher.name)
    try:
        with progress(quiet) as shown:
            metrics, timings = run_log(
                folder, header, resolved, log, shown, (viewer or AUTO) if live else None
            )
    except KeyboardInterrupt as error:
        raise KeyboardInterrupt(f"go on with: hsslam run --resume {folder.path}") from error
    if profile:
        console.pairs(stages(timings))
    if not quiet:
        console.pairs(summary(folder, log, metrics, timings))
        if log.info.attribution:
            console.say(f"\n{log.info.attribution}")


def _source(
    dataset: str | None,
    topics: dict[str, str | None],
    scans: int | None,
    on_error: str | None,
    died: Header | None,
) -> dict[str, Any]:
    """What opens the scans: told by the options; what they leave out, by the journal of the run that died."""
    from hsslam.datasets.catalogue import join_source

    under = {"on_error": "stop", **(died.dataset if died is not None else {})}
    dataset = dataset if dataset is not None else under.get("source")
    if dataset is None:
        raise ConfigError("say what to run on: a name that `hsslam datasets` lists, or a log")
    told = {"source": join_source(dataset, **topics), "scans": scans, "on_error": on_error}
    return {**told, **{key: value for key, value in under.items() if told[key] is None}}
