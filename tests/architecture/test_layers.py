"""The layer rules of ARCHITECTURE.md, kept by reading every import."""

import ast
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

from tests.architecture.measure_house import parse

ROOT = Path(__file__).parents[2]
#: Parts of ``damping``, each of which may import itself and what stands before it.
LAYERS = (
    "errors",
    "arrays",
    "progress",
    "forces",
    "effects",
    "records",
    "signals",
    "predict",
    "regression",
    "infer",
    "ranking",
    "extrapolation",
    "gap",
    "agreement",
    "formats",
    "campaign",
    "plots",
    "report",
    "result",
    "ranked_law",
    "answers",
    "api",
)
#: The houses and what each may import beside itself: nobody imports an exhibit but the exhibits and a hook.
HOUSES = {
    "damping": set(),
    "damping_pipelines": {"damping"},
    "damping_reed1970": {"damping", "damping_pipelines", "damping_validation"},
    "damping_validation": {"damping", "damping_pipelines"},
}
LIBRARY = ROOT / "selection" / "damping"
MODULES = sorted(LIBRARY.rglob("*.py")) + sorted((ROOT / "pipelines").rglob("*.py"))
SELECTION = [path for path in MODULES if path.is_relative_to(LIBRARY)]
#: Modules that write files: the writer, and what moves staged results into place.
WRITERS = {ROOT / "pipelines" / "damping_pipelines" / name for name in ("store.py", "manifest.py")}


def name(path: Path) -> str:
    return str(path.relative_to(ROOT))


def dotted(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts[1:]).removesuffix(".__init__")


@cache
def nodes(path: Path) -> list[ast.AST]:
    """Every node of a module's syntax."""
    return list(ast.walk(parse(path)))


@cache
def imported(path: Path) -> list[str]:
    """Full names of the project's modules that a file imports, wherever in the file."""
    found = []
    for node in nodes(path):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name(path)}: relative import"
            found += [f"{node.module}.{alias.name}" for alias in node.names]
    return found


def calls(paths: Iterable[Path]) -> Iterator[tuple[str, ast.Call]]:
    """Every call in the files with its place."""
    for path in paths:
        yield from ((f"{name(path)}:{node.lineno}", node) for node in nodes(path) if isinstance(node, ast.Call))


def imports(paths: Iterable[Path]) -> Iterator[tuple[Path, str]]:
    return ((path, module) for path in paths for module in imported(path))


def test_imports_go_one_way():
    for path, module in imports(SELECTION):
        own, parts = [*dotted(path).split("."), "api"][1], module.split(".")
        if parts[0] == "damping" and parts[1] in LAYERS:
            assert LAYERS.index(parts[1]) <= LAYERS.index(own), f"{name(path)} imports {module} against the arrow"


def test_houses_import_only_what_they_may():
    for path, module in imports(MODULES):
        house, top = dotted(path).split(".")[0], module.split(".")[0]
        may = top in HOUSES[house] | {house} or top not in {*HOUSES, "tests", "benchmarks"}
        assert may, f"{name(path)} imports {module}"


def test_pyplot_is_never_imported():
    """It holds global state: figures here are made as objects."""
    found = [name(path) for path, module in imports(MODULES) if "pyplot" in module or module.endswith("pylab")]
    assert found == []


def test_one_place_touches_arviz():
    """Version 1 of arviz is another library; whoever comes to it finds one door."""
    assert [name(path) for path in MODULES if "arviz" in {module.split(".")[0] for module in imported(path)}] == [
        "selection/damping/infer/chains.py"
    ]


def test_the_library_neither_prints_nor_writes():
    writers = {"write_text", "write_bytes", "to_csv", "to_netcdf", "savefig", "mkdir", "unlink", "rename", "touch"}
    for where, node in calls(SELECTION):
        function = node.func
        if isinstance(function, ast.Name):
            assert function.id != "print", f"{where} prints"
        if isinstance(function, ast.Attribute):
            # a frame that is turned into text and a figure drawn into memory write nothing
            into_memory = function.attr == "to_csv" and not node.args
            into_buffer = function.attr == "savefig" and isinstance(node.args[0], ast.Name)
            allowed = into_memory or into_buffer
            assert function.attr not in writers or allowed, f"{where} writes: {function.attr}"
        if isinstance(function, ast.Name) and function.id == "open":
            assert len(node.args) == 1, f"{where} opens a file for writing"


def test_only_the_store_opens_files_for_writing():
    for where, node in calls(path for path in MODULES if path not in WRITERS):
        if isinstance(node.func, ast.Attribute):
            assert node.func.attr not in ("write_text", "write_bytes"), where


def test_there_are_no_circles():
    """Imports between modules form no cycle (late imports included)."""
    known = {dotted(path): path for path in MODULES}
    arrows = {}
    for module, path in known.items():
        targets = set()
        for other in imported(path):
            for candidate in (other, other.rpartition(".")[0]):
                if candidate in known and candidate != module:
                    targets.add(candidate)
                    break
        arrows[module] = targets
    done, stack = set(), []

    def visit(module):
        assert module not in stack, " -> ".join([*stack[stack.index(module) :], module])
        if module in done:
            return
        stack.append(module)
        for target in arrows[module]:
            visit(target)
        done.add(stack.pop())

    for module in arrows:
        visit(module)
