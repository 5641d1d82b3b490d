"""The arrows of the design: who may import whom, and what may be imported when."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
HEAVY = {"numba", "gtsam", "matplotlib", "scipy", "open3d", "kiss_icp"}

FORBIDDEN = {
    # module prefix: prefixes it must not import; the longest matching prefix counts, and those of hsslam add up.
    "hsslam": ("hsslam_plugins", "evo"),
    "hsslam.se2": ("hsslam.",),
    "hsslam.kernels": ("hsslam.",),
    "hsslam.matching": ("hsslam.",),
    "hsslam.registry": ("hsslam.",),
    "hsslam.plugin_files": ("hsslam.",),
    "hsslam.search": ("hsslam.",),
    "hsslam.scan": ("hsslam.",),
    "hsslam.trajectory": ("hsslam.",),
    "hsslam.config": ("hsslam.slam", "hsslam.cli", "hsslam_eval"),
    "hsslam.datasets": ("hsslam.slam", "hsslam.cli", "hsslam_eval"),
    "hsslam.io": ("hsslam.slam", "hsslam.cli", "hsslam_eval"),
    "hsslam.mapping": ("hsslam.slam", "hsslam.cli", "hsslam_eval"),
    "hsslam.slam": ("hsslam.live", "hsslam.cli", "hsslam_eval"),
    "hsslam.live": ("hsslam.cli", "hsslam_eval"),
    "hsslam_eval": ("hsslam.cli", "hsslam_plugins", "evo"),
    "hsslam_plugins": ("hsslam", "hsslam_eval", "evo"),
}

ALLOWED = {
    "hsslam.se2": ("hsslam.jit",),
    "hsslam.kernels": ("hsslam.kernels", "hsslam.jit", "hsslam.se2"),
    "hsslam.matching": (
        "hsslam.matching",
        "hsslam.kernels",
        "hsslam.se2",
        "hsslam.errors",
        "hsslam.probe",
        "hsslam.registry",
        "hsslam.validation",
    ),
    "hsslam.registry": ("hsslam.errors", "hsslam.plugin_files"),
    "hsslam.plugin_files": ("hsslam.errors",),
    "hsslam.search": (
        "hsslam.search",
        "hsslam.matching",
        "hsslam.kernels",
        "hsslam.se2",
        "hsslam.jit",
        "hsslam.errors",
        "hsslam.registry",
        "hsslam.validation",
    ),
    "hsslam.scan": ("hsslam.jit", "hsslam.se2"),
    "hsslam.trajectory": ("hsslam.se2",),
    "hsslam_plugins": ("hsslam_plugins", "hsslam.matching", "hsslam.search", "hsslam.errors"),
}

MAY_IMPORT_EVALUATION = ("hsslam.cli", "hsslam_eval")


def within(name: str, prefix: str) -> bool:
    return name == prefix or name.startswith(prefix.rstrip(".") + ".")


def sources() -> Iterator[tuple[str, Path]]:
    for folder in (ROOT / "hsslam", ROOT / "plugins" / "hsslam_plugins", ROOT / "eval" / "hsslam_eval"):
        for path in sorted(folder.rglob("*.py")):
            parts = path.relative_to(folder.parent).with_suffix("").parts
            yield ".".join(parts[:-1] if parts[-1] == "__init__" else parts), path


def imports(tree: ast.AST, module: str, package: bool, everywhere: bool = True) -> Iterator[tuple[int, str]]:
    """Line and full name of everything imported; at import time only where ``everywhere`` is False."""
    nodes = ast.walk(tree) if everywhere else at_import_time(tree)
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parts = module.split(".")
                kept = parts[: len(parts) - node.level + (1 if package else 0)]
                base = ".".join([*kept, base] if base else kept)
            yield from ((node.lineno, f"{base}.{alias.name}") for alias in node.names)


def at_import_time(tree: ast.AST) -> Iterator[ast.AST]:
    """Nodes that run when a module is imported: outside of functions and of ``if TYPE_CHECKING``."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            continue
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            continue
        yield node
        yield from at_import_time(node)


def rules_of(table: dict[str, tuple[str, ...]], module: str) -> set[str]:
    return {entry for prefix, entries in table.items() if within(module, prefix) for entry in entries}


def violations(module: str, tree: ast.AST, package: bool) -> list[str]:
    forbidden, allowed = rules_of(FORBIDDEN, module), rules_of(ALLOWED, module)
    if not any(within(module, prefix) for prefix in MAY_IMPORT_EVALUATION):
        forbidden = {*forbidden, "hsslam_eval"}
    return [
        f"{module}:{line} imports {name}"
        for line, name in imports(tree, module, package)
        if any(within(name, prefix) for prefix in forbidden)
        and not any(within(name, prefix) for prefix in allowed)
    ]


def parsed() -> list[tuple[str, ast.AST, bool]]:
    return [
        (name, ast.parse(path.read_text("utf-8")), path.name == "__init__.py") for name, path in sources()
    ]


def test_there_is_something_to_check() -> None:
    found = {name for name, _ in sources()}
    assert {"hsslam.se2", "hsslam.matching", "hsslam_plugins.hide", "hsslam_eval"} <= found


def test_arrows_point_one_way() -> None:
    assert [line for module in parsed() for line in violations(*module)] == []


@pytest.mark.parametrize(
    ("module", "statement"),
    [
        ("hsslam.se2", "from hsslam.kernels import surface"),
        ("hsslam.kernels.surface", "import hsslam.matching"),
        ("hsslam.matching.interface", "from hsslam.slam import events"),
        ("hsslam.matching.interface", "from ..slam import events"),
        ("hsslam.search.hide", "from hsslam.slam.events import Event"),
        ("hsslam.io.carmen", "from hsslam.slam import pipeline"),
        ("hsslam.slam.pipeline", "import hsslam_eval.metrics"),
        ("hsslam.slam.pipeline", "from hsslam import cli"),
        ("hsslam.slam.pipeline", "def f():\n    import hsslam_plugins.hide"),
        ("hsslam.slam.pipeline", "from hsslam.live import LiveMap"),
        ("hsslam.live.feed", "from hsslam.cli import console"),
        ("hsslam.datasets.catalogue", "import hsslam.cli.main"),
        ("hsslam.environment", "import hsslam_eval"),
        ("hsslam_eval.trials", "from hsslam.cli import console"),
        ("hsslam_eval.metrics", "import evo.core"),
        ("hsslam_plugins.icp", "from hsslam.slam.events import Event"),
        ("hsslam_plugins.icp", "from hsslam.kernels.surface import Surface"),
        ("hsslam_plugins.icp", "import hsslam_eval"),
    ],
)
def test_the_rules_catch_a_wrong_arrow(module: str, statement: str) -> None:
    assert len(violations(module, ast.parse(statement), package=False)) == 1


@pytest.mark.parametrize(
    ("module", "statement"),
    [
        ("hsslam.slam.pipeline", "from hsslam.matching import Matcher"),
        ("hsslam.cli.main", "def f():\n    import hsslam_eval"),
        ("hsslam_plugins.kiss_icp", "import kiss_icp.mapping\nfrom hsslam_plugins.local import in_space"),
        ("hsslam_eval.trials", "from hsslam.slam.pipeline import Slam"),
        ("hsslam.kernels.assess", "from hsslam.se2 import Pose"),
    ],
)
def test_the_rules_let_a_right_arrow_pass(module: str, statement: str) -> None:
    assert violations(module, ast.parse(statement), package=False) == []


def test_optional_packages_are_imported_inside_functions_only() -> None:
    found = [
        f"{name}:{line} imports {imported}"
        for name, tree, package in parsed()
        for line, imported in imports(tree, name, package, everywhere=False)
        if imported.split(".")[0]
        in {
            "open3d",
            "kiss_icp",
            "libusb_package",
            "rosbags",
            "evo",
            "pytest",
            "dask",
            "distributed",
            "rerun",
        }
    ]
    assert found == []


def test_the_command_line_imports_nothing_heavy_at_its_top() -> None:
    found = [
        f"{name}:{line} imports {imported}"
        for name, tree, package in parsed()
        if within(name, "hsslam.cli")
        for line, imported in imports(tree, name, package, everywhere=False)
        if imported.split(".")[0] in HEAVY
    ]
    assert found == []


def loaded_after(statement: str) -> set[str]:
    script = f"import sys\n{statement}\nprint(' '.join(sorted({{m.split('.')[0] for m in sys.modules}})))"
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True, cwd=ROOT
    )
    return set(done.stdout.split())


def test_the_command_line_loads_nothing_heavy() -> None:
    assert loaded_after("import hsslam.cli.main") & {*HEAVY, "hsslam_eval", "hsslam_plugins"} == set()


def test_the_plugins_load_their_libraries_only_when_used() -> None:
    loaded = loaded_after("import hsslam_plugins.icp, hsslam_plugins.kiss_icp")
    assert loaded & {"open3d", "kiss_icp", "gtsam", "matplotlib"} == set()
    assert "hsslam_plugins" in loaded


def test_modules_stay_small() -> None:
    long = {name: n for name, path in sources() if (n := len(path.read_text("utf-8").splitlines())) > 400}
    assert long == {}
