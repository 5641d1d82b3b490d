"""``hsslam doctor``: what is installed, what is missing, and the line that mends it."""

from __future__ import annotations

from typing import Annotated

import typer

from hsslam.cli import console
from hsslam.cli.options import AsJson, DataDir, Plugin

SIGNS = {"ok": "ok", "missing": "-", "broken": "BROKEN"}


def doctor(
    strict: Annotated[
        bool, typer.Option("--strict", help="Exit code 1 also where something optional is missing.")
    ] = False,
    data_dir: DataDir = None,
    plugin: Plugin = None,
    as_json: AsJson = False,
) -> None:
    """Tell what is installed, what is missing, what mends it.

    Exit code 0 where everything needed is there and works (optional parts may be missing), else 1.
    """
    from dataclasses import asdict

    from hsslam.doctor import examine

    findings = list(examine(data_dir))
    if as_json:
        console.print_json([asdict(finding) for finding in findings])
    else:
        console.table(
            ("", "what", "found"),
            [(SIGNS[finding.status], finding.what, finding.detail) for finding in findings],
        )
        for title, status in (("broken", "broken"), ("missing, and optional", "missing")):
            mended = [f for f in findings if f.status == status and f.remedy]
            if mended:
                console.say(f"\n{title}; mend it with:")
                console.table(("", ""), [(f"  {f.what}", f.remedy) for f in mended])
    bad = {"broken", "missing"} if strict else {"broken"}
    if any(finding.status in bad for finding in findings):
        raise typer.Exit(1)
