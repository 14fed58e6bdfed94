"""Reads the imports of the whole package and keeps the arrows between its rooms one-way."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "gearmon"

# Who may import whom: a room may always import from itself.
FOUNDATIONS = {"arrays", "errors", "files", "lazy", "result", "threads", "units"}
ALLOWED = {
    "arrays": set(),
    "errors": set(),
    "lazy": {"errors"},
    "files": {"errors"},
    "result": {"errors", "files"},
    "threads": {"errors"},
    "units": set(),
    "machine": FOUNDATIONS,
    "gears": FOUNDATIONS | {"machine"},
    "dynamics": FOUNDATIONS,
    "signals": FOUNDATIONS,
    "signatures": FOUNDATIONS | {"machine", "gears", "dynamics", "signals"},
    "diagnosis": FOUNDATIONS | {"machine", "gears", "dynamics", "signals", "signatures"},
    "simulation": FOUNDATIONS | {"machine", "gears", "dynamics", "terminal"},
    "harvesting": FOUNDATIONS | {"machine", "dynamics", "signals", "signatures"},
    "exposure": FOUNDATIONS | {"machine", "gears", "signals", "signatures"},
}
COMPUTING = set(ALLOWED)
ALLOWED["report"] = COMPUTING
ALLOWED["terminal"] = {"errors"}
ALLOWED["fleet"] = COMPUTING | {"report"}
ALLOWED["benchmark"] = COMPUTING | {"report", "terminal"}
ALLOWED["study"] = FOUNDATIONS | {"gears", "dynamics", "harvesting"}
ALLOWED["study"] |= {"report", "benchmark", "terminal"}
# the front door hands out public names; the commands may use everything
ALLOWED["gearmon"] = COMPUTING | {"report"}
ALLOWED["__main__"] = {"cli"}
EVERYTHING = COMPUTING | {"report", "fleet", "benchmark", "study", "terminal"}
FRONT = {"cli", "demos", "commands"}
for front in FRONT:
    ALLOWED[front] = EVERYTHING | FRONT

# Libraries that only some modules may load, wherever in the module the import stands.
OWNED = {
    "matplotlib": lambda module: (
        (module.startswith("gearmon.report.") and "plots" in module)
        or module in ("gearmon.benchmark.plots", "gearmon.study.report")
    ),
    "sklearn": lambda module: module.startswith(("gearmon.diagnosis", "gearmon.benchmark")),
    "scipy.signal": lambda module: module.startswith(
        ("gearmon.benchmark", "gearmon.exposure", "gearmon.harvesting", "gearmon.signals")
    ),
    "scipy.stats": lambda module: module.startswith(
        ("gearmon.benchmark", "gearmon.fleet", "gearmon.harvesting")
    ),
}
# Known debts, to be paid; a new one fails, and so does one that is paid and still stands here.
OWED_LIBRARIES: set[tuple[str, str]] = set()
OWED_CYCLES: set[tuple[str, str]] = set()
# A class that derives from one of scikit-learn's needs it when it is defined; every module that
# imports this one does so inside a function.
DERIVED = {"gearmon.diagnosis.fault_types.classifier": "sklearn"}
HEAVY = ("scipy.signal", "scipy.stats", "pandas", "matplotlib", "sklearn", "pyarrow")


def modules():
    """All modules of the package by their dotted names."""
    found = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


MODULES = modules()


@cache
def tree(name):
    """The source of a module."""
    return ast.parse(MODULES[name].read_text(encoding="utf-8"))


def imports(name, path, nodes):
    """Every module that is imported in these nodes of a module; relative names made absolute."""
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from _from(node, package)
        elif isinstance(node, ast.Call) and _is_import_call(node):
            yield from _called(node, package)
        elif isinstance(node, ast.Attribute) and getattr(node.value, "id", "") == "scipy":
            # SciPy loads its parts when they are first asked for
            yield f"scipy.{node.attr}"


def _from(node, package):
    above = package.split(".")
    above = above[: len(above) - node.level + 1] if node.level else []
    origin = ".".join([*above, *([node.module] if node.module else [])])
    for alias in node.names:
        whole = f"{origin}.{alias.name}"
        # a name of a package may be one of its modules, or an object that stands in it
        yield whole if whole in MODULES or not origin.startswith("gearmon") else origin


def _is_import_call(node):
    called = (
        node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
    )
    return called in {"import_module", "__import__"}


def _called(node, package):
    given = node.args[0] if node.args else None
    if isinstance(given, ast.Constant) and isinstance(given.value, str):
        name = given.value
        yield f"{package}.{name.lstrip('.')}" if name.startswith(".") else name


def room(module):
    """The room of a module: the part after the package's name."""
    parts = module.split(".")
    return parts[1] if len(parts) > 1 else parts[0]


@cache
def imported():
    """What every module imports, at whatever level."""
    return {name: set(imports(name, path, ast.walk(tree(name)))) for name, path in MODULES.items()}


@cache
def edges():
    """What every module imports of the package."""
    return {
        name: {t for t in own if t.split(".")[0] == "gearmon"} for name, own in imported().items()
    }


def test_package_was_found():
    assert {"gearmon", "gearmon.errors", "gearmon.signals.angle"} <= set(MODULES)


@pytest.mark.parametrize("module", MODULES)
def test_arrows_point_downwards_only(module):
    here = room(module)
    assert here in ALLOWED, f"{here} has no place in the house: enter it in ALLOWED"
    for target in edges()[module]:
        there = room(target)
        if there == here or target == "gearmon":  # the version stands in the package itself
            continue
        assert there in ALLOWED[here], f"{module} imports {target}"


def test_package_itself_gives_its_version_only():
    for name in MODULES:
        for node in ast.walk(tree(name)):
            if isinstance(node, ast.ImportFrom) and node.level == 0 and node.module == "gearmon":
                names = {alias.name for alias in node.names}
                objects = {n for n in names if f"gearmon.{n}" not in MODULES}
                assert objects <= {"__version__"}, f"{name} imports {objects} from gearmon"


def test_nobody_imports_the_command_line():
    callers = {name for name, targets in edges().items() if any(room(t) == "cli" for t in targets)}
    assert {room(name) for name in callers} <= {"__main__", "cli"}


def test_gears_and_dynamics_do_not_know_each_other():
    assert not any(
        room(t) == "dynamics" for n, ts in edges().items() if room(n) == "gears" for t in ts
    )
    assert not any(
        room(t) == "gears" for n, ts in edges().items() if room(n) == "dynamics" for t in ts
    )


@pytest.mark.parametrize("library", OWNED)
def test_libraries_are_loaded_by_their_owners_only(library):
    strangers = {
        (name, library)
        for name, targets in imported().items()
        if any(f"{target}.".startswith(f"{library}.") for target in targets)
        and not OWNED[library](name)
    }
    assert strangers == {(name, owed) for name, owed in OWED_LIBRARIES if owed == library}


def test_heavy_libraries_are_imported_inside_functions():
    for name, path in MODULES.items():
        if name.startswith("gearmon.report.") and "plots" in name:
            continue
        if name in ("gearmon.benchmark.plots", "gearmon.study.report"):
            continue
        top = ast.Module(body=list(_at_import(tree(name).body)), type_ignores=[])
        for target in imports(name, path, ast.walk(top)):
            assert target not in DERIVED, f"{name} imports {target} at its top"
            if name in DERIVED and target.split(".")[0] == DERIVED[name]:
                continue
            assert not target.startswith(HEAVY), f"{name} imports {target} at its top"


def _at_import(body):
    """Statements that run on import, without what only type checkers read."""
    for node in body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            continue
        yield from node.orelse if _is_for_type_checkers(node) else [node]


def _is_for_type_checkers(node):
    return isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)


def _at_run_time(node):
    """All nodes below one, without what only type checkers read."""
    waiting = [node]
    while waiting:
        node = waiting.pop()
        yield node
        waiting.extend(node.orelse if _is_for_type_checkers(node) else ast.iter_child_nodes(node))


@cache
def loads(name):
    """Modules of the package that a module imports when it runs, at whatever level."""
    found = imports(name, MODULES[name], _at_run_time(tree(name)))
    return {t for t in found if t in MODULES and t != "gearmon"}


def reachable(start):
    """All modules that a module loads, by way of others too."""
    found, waiting = set(), [start]
    while waiting:
        new = loads(waiting.pop()) - found
        found |= new
        waiting.extend(new)
    return found


def test_no_module_imports_itself_by_way_of_others():
    in_cycle = {name for name in MODULES if name != "gearmon" and name in reachable(name)}
    assert in_cycle == {name for pair in OWED_CYCLES for name in pair}


def test_rooms_have_names_of_their_own():
    vague = {"utils", "util", "core", "common", "helpers", "misc", "tools", "lib"}
    assert not vague & {part for name in MODULES for part in name.split(".")}
    folders = {path.name for path in PACKAGE.rglob("*") if path.is_dir()}
    assert not vague & folders


@pytest.mark.parametrize(
    ("code", "found"),
    [
        ("def f():\n    from gearmon.cli import main", {"gearmon.cli"}),
        ("def f():\n    from ..cli import main", {"gearmon.cli"}),
        ("from .. import cli", {"gearmon.cli"}),
        ("from .indicators import rms", {"gearmon.signals.indicators"}),
        ("from . import indicators", {"gearmon.signals.indicators"}),
        ("import importlib\nimportlib.import_module('gearmon.cli')", {"importlib", "gearmon.cli"}),
        ("from gearmon import __version__", {"gearmon"}),
        ("class A:\n    def f(self):\n        import scipy.signal", {"scipy.signal"}),
        ("from scipy import signal", {"scipy.signal"}),
    ],
)
def test_every_kind_of_import_is_seen(code, found):
    path = PACKAGE / "signals" / "angle.py"
    assert set(imports("gearmon.signals.angle", path, ast.walk(ast.parse(code)))) == found
