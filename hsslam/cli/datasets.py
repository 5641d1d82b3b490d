"""``hsslam datasets``: what there is, where it is, fetching the real ones, writing the simulated ones."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from hsslam.cli import console
from hsslam.cli.options import AsJson, DataDir, OdomTopic, Plugin, Quiet, Scans, ScanTopic, Seed
from hsslam.cli.progress import progress
from hsslam.errors import DataError

app: typer.Typer = typer.Typer(help="List, inspect, fetch and simulate datasets.", rich_markup_mode=None)

_LOG_SUFFIXES = (".clf", ".log", ".clf.gz", ".clf.bz2", ".log.gz", ".log.bz2")


@app.callback(invoke_without_command=True)
def default(context: typer.Context, plugin: Plugin = None) -> None:
    """List, inspect, fetch and simulate datasets."""
    if context.invoked_subcommand is None:
        show()


@app.command("list")
def show(data_dir: DataDir = None, as_json: AsJson = False) -> None:
    """List the datasets, and which are on this machine."""
    from hsslam.datasets import catalogue

    rows = []
    for name in catalogue.names():
        info = catalogue.describe(name)
        rows.append((info, _where(name, info.kind, data_dir)))
    if as_json:
        console.print_json([{**asdict(info), "where": where} for info, where in rows])
        return
    console.table(
        ("name", "kind", "scans", "what", "where"),
        [(info.name, info.kind, _count(info.scan_count), info.description, where) for info, where in rows],
    )
    console.say(f"\ndata folder: {catalogue.data_directory(data_dir)}")


@app.command()
def info(
    name: Annotated[str, typer.Argument(metavar="NAME|PATH", help="A dataset, or a log.")],
    data_dir: DataDir = None,
    seed: Seed = None,
    scans: Scans = None,
    scan_topic: ScanTopic = None,
    odom_topic: OdomTopic = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Read a dataset through and say what is in it.

    Scans, beams, duration, truth.
    """
    import numpy as np

    from hsslam.datasets.catalogue import join_source, open_dataset
    from hsslam.datasets.file import FileDataset

    source = join_source(name, scan_topic=scan_topic, odom_topic=odom_topic)
    log = open_dataset(source, data_dir=data_dir, seed=seed or 0, scans=scans)
    beams: dict[int, int] = {}
    stamps: list[float] = []
    travelled = 0.0
    last = None
    with progress(quiet or as_json) as shown:
        shown.stage(f"reading {log.info.name}", log.info.scan_count or scans, "scans")
        for done, scan in enumerate(log.scans(), start=1):
            beams[len(scan.ranges)] = beams.get(len(scan.ranges), 0) + 1
            stamps.append(scan.stamp)
            if last is not None:
                travelled += float(np.hypot(*(scan.odometry - last)[:2]))
            last = scan.odometry
            shown.update(done)
    if not stamps:
        raise DataError(f"{name}: holds no scan")
    relations = log.relations()
    notes = log.statistics.notes if isinstance(log, FileDataset) else []
    found = {
        **asdict(log.info),
        "scan_count": len(stamps),
        "beams": beams,
        "duration_s": float(np.ptp(stamps)),
        "odometry_m": travelled,
        "truth": log.truth() is not None,
        "relations": len(relations) if relations is not None else 0,
        "notes": notes,
    }
    if as_json:
        console.print_json(found)
        return
    console.pairs(
        [
            ("name", log.info.name),
            ("kind", log.info.kind),
            ("what", log.info.description),
            ("scans", f"{len(stamps):,}"),
            ("beams", ", ".join(f"{count} ({scans:,} scans)" for count, scans in sorted(beams.items()))),
            ("duration", f"{found['duration_s']:,.0f} s"),
            ("travelled", f"{travelled:,.0f} m by odometry"),
            *(("log", note) for note in notes),
            ("truth", "exact poses" if found["truth"] else f"{found['relations']:,} relations"),
            *([("attribution", log.info.attribution)] if log.info.attribution else []),
        ]
    )


@app.command()
def fetch(
    name: Annotated[str, typer.Argument(help="A real dataset's name.")],
    data_dir: DataDir = None,
    quiet: Quiet = False,
) -> None:
    """Download a real dataset from its public home and check it."""
    from hsslam.datasets.fetch import fetch as fetch_dataset

    with progress(quiet) as shown:
        file = ""

        def tell(part: str, done: int, total: int) -> None:
            nonlocal file
            if part != file:
                file = part
                shown.stage(f"fetching {part}", total or None, "bytes")
            shown.update(done)

        report = fetch_dataset(name, data_dir, progress=tell)
    if not quiet:
        console.say(str(report))


@app.command()
def simulate(
    name: Annotated[str, typer.Argument(help="A simulated dataset's name.")],
    out: Annotated[Path, typer.Option(metavar="FILE", help="The CARMEN log to write; .gz or .bz2 packs it.")],
    scans: Scans = None,
    seed: Seed = None,
    laser: Annotated[
        str, typer.Option(metavar="PRESET", help="The simulated laser: sick-lms200, urg-04lx or rplidar-a2.")
    ] = "sick-lms200",
    quiet: Quiet = False,
) -> None:
    """Write a simulated dataset as a CARMEN log.

    Its exact poses go beside it, as FILE.truth.tum.
    """
    from hsslam.datasets.simulator import SimulatedDataset
    from hsslam.io.carmen import CarmenWriter
    from hsslam.io.tum import write_tum

    stem = next((out.name.removesuffix(s) for s in reversed(_LOG_SUFFIXES) if out.name.endswith(s)), None)
    if stem is None:
        raise DataError(f"{out}: expected a name that ends in one of {', '.join(_LOG_SUFFIXES)}")
    log = SimulatedDataset(name, seed=seed or 0, scans=scans, laser=laser)
    count = 0
    with progress(quiet) as shown, CarmenWriter(out) as writer:
        shown.stage(f"simulating {name}", log.info.scan_count, "scans")
        for count, scan in enumerate(log.scans(), start=1):
            writer.write(scan)
            shown.update(count)
    truth = out.with_name(f"{stem}.truth.tum")
    write_tum(truth, log.truth())
    if not quiet:
        console.say(f"{out}: {count:,} scans")
        console.say(f"{truth}: their exact poses")


def _where(name: str, kind: str, data_dir: Path | None) -> str:
    from hsslam.datasets.catalogue import open_dataset

    if kind == "unavailable":
        return "hsslam doctor"
    if kind == "simulated":
        return "built in"
    try:
        open_dataset(name, data_dir=data_dir)
    except DataError:
        return f"hsslam datasets fetch {name}"
    return "present"


def _count(scans: int | None) -> str:
    return "" if scans is None else f"{scans:,}"
