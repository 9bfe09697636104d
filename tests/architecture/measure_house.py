"""The size and shape of the house in numbers: ``python tests/architecture/measure_house.py``."""

from __future__ import annotations

import ast
import statistics
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
HOUSES = ("damping", "damping_pipelines", "damping_reed1970", "damping_validation")
#: A file below this many lines is short, unless it is an empty door of a package or a catalogue.
SHORT = 40
#: Longest function allowed, lines.
LONGEST = 60
#: First words of functions that do something. A quantity keeps its noun: ``energy_factor``, ``log_likelihood``.
VERBS = frozenset(
    [
        "accept",
        "add",
        "adjust",
        "advance",
        "agree",
        "allow",
        "announce",
        "answer",
        "append",
        "apply",
        "approximate",
        "ask",
        "assert",
        "assign",
        "attach",
        "average",
        "balance",
        "begin",
        "bin",
        "bound",
        "bracket",
        "build",
        "calibrate",
        "call",
        "cap",
        "carry",
        "catch",
        "check",
        "choose",
        "classify",
        "clip",
        "close",
        "cluster",
        "collect",
        "combine",
        "compare",
        "complete",
        "compose",
        "compute",
        "condition",
        "confirm",
        "contain",
        "continue",
        "convert",
        "copy",
        "count",
        "cover",
        "create",
        "cross",
        "cut",
        "declare",
        "decide",
        "decompose",
        "demean",
        "derive",
        "describe",
        "detect",
        "diagnose",
        "differentiate",
        "discard",
        "divide",
        "draw",
        "drop",
        "eliminate",
        "end",
        "enlarge",
        "ensure",
        "enter",
        "enumerate",
        "estimate",
        "evaluate",
        "exclude",
        "expand",
        "explain",
        "export",
        "extend",
        "extrapolate",
        "factor",
        "fail",
        "fetch",
        "fill",
        "filter",
        "find",
        "finish",
        "fit",
        "fix",
        "flag",
        "fold",
        "follow",
        "format",
        "forget",
        "formulate",
        "freeze",
        "gather",
        "generate",
        "get",
        "give",
        "go",
        "grade",
        "grow",
        "guard",
        "guess",
        "handle",
        "hash",
        "have",
        "hide",
        "hold",
        "identify",
        "import",
        "improve",
        "include",
        "infer",
        "initialise",
        "insert",
        "integrate",
        "interpolate",
        "interpret",
        "invert",
        "is",
        "iterate",
        "join",
        "judge",
        "justify",
        "keep",
        "label",
        "lay",
        "leave",
        "limit",
        "link",
        "list",
        "load",
        "locate",
        "lock",
        "log",
        "look",
        "make",
        "map",
        "mark",
        "marginalise",
        "mask",
        "match",
        "maximise",
        "measure",
        "merge",
        "minimise",
        "mix",
        "move",
        "name",
        "narrow",
        "need",
        "normalise",
        "note",
        "number",
        "observe",
        "offer",
        "open",
        "optimise",
        "order",
        "pack",
        "pad",
        "pair",
        "parse",
        "pass",
        "pick",
        "place",
        "plan",
        "plot",
        "polish",
        "pool",
        "position",
        "predict",
        "prefer",
        "prepare",
        "print",
        "process",
        "produce",
        "profile",
        "project",
        "propose",
        "prune",
        "publish",
        "pull",
        "put",
        "quote",
        "raise",
        "rank",
        "reach",
        "read",
        "rebuild",
        "recognise",
        "recompute",
        "record",
        "reduce",
        "refer",
        "refine",
        "refit",
        "refuse",
        "regress",
        "reject",
        "release",
        "remove",
        "render",
        "repeat",
        "replace",
        "report",
        "represent",
        "reproduce",
        "require",
        "resample",
        "reset",
        "resolve",
        "restore",
        "restrict",
        "resume",
        "return",
        "round",
        "run",
        "sample",
        "save",
        "say",
        "scale",
        "scan",
        "score",
        "screen",
        "seal",
        "search",
        "select",
        "send",
        "separate",
        "set",
        "settle",
        "shift",
        "show",
        "shorten",
        "shrink",
        "shut",
        "simulate",
        "skip",
        "smooth",
        "solve",
        "sort",
        "spell",
        "splice",
        "split",
        "spread",
        "square",
        "stack",
        "standardise",
        "start",
        "state",
        "stay",
        "step",
        "stop",
        "store",
        "strip",
        "subtract",
        "sum",
        "summarise",
        "support",
        "swap",
        "sweep",
        "take",
        "tell",
        "test",
        "thin",
        "tidy",
        "tilt",
        "time",
        "title",
        "transform",
        "translate",
        "tree",
        "trim",
        "truncate",
        "try",
        "tune",
        "unpack",
        "update",
        "use",
        "validate",
        "vary",
        "verify",
        "view",
        "wait",
        "walk",
        "warn",
        "watch",
        "weigh",
        "whiten",
        "widen",
        "window",
        "wrap",
        "write",
    ]
)


@dataclass(frozen=True)
class Function:
    """A function of a module: where, its name and its lines, decorators and docstring included."""

    path: Path
    name: str
    lines: int

    @property
    def does(self) -> bool:
        """Whether its name begins with a verb."""
        return self.name.lstrip("_").split("_")[0] in VERBS


def modules() -> list[Path]:
    """Every module of the four houses."""
    return sorted(
        path
        for house in HOUSES
        for path in (ROOT / ("selection" if house == "damping" else "pipelines") / house).rglob("*.py")
    )


def functions(path: Path) -> list[Function]:
    """Functions and methods of a module but for those that Python names (``__init__``) and fields (properties)."""
    return [
        Function(path, node.name, (node.end_lineno or node.lineno) - node.lineno + 1)
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.FunctionDef)
        and not node.name.startswith("__")
        and not any(isinstance(d, ast.Name) and "property" in d.id for d in node.decorator_list)
    ]


def duplicate_classes() -> dict[str, list[str]]:
    """Class names that are defined more than once, with the modules that define them."""
    found: dict[str, list[str]] = defaultdict(list)
    for path in modules():
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ClassDef):
                found[node.name].append(str(path.relative_to(ROOT)))
    return {name: paths for name, paths in sorted(found.items()) if len(paths) > 1}


def tuple_constants() -> list[str]:
    """Places where constants share one assignment, ``A, B = 1, 2``: each wants its own name, unit and reason."""
    return [
        f"{path.relative_to(ROOT)}:{node.lineno} {ast.unparse(node)}"
        for path in modules()
        for node in ast.parse(path.read_text()).body
        if isinstance(node, ast.Assign)
        and isinstance(node.targets[0], ast.Tuple)
        and any(isinstance(name, ast.Name) and name.id.isupper() for name in node.targets[0].elts)
    ]


def short_files() -> list[str]:
    """Modules that hold a thing or two and are no door of a package."""
    lines = {path: len(path.read_text().splitlines()) for path in modules()}
    return [f"{path.relative_to(ROOT)} {n}" for path, n in lines.items() if 1 < n < SHORT]


def write() -> None:
    """Print the measures."""
    every = [function for path in modules() for function in functions(path)]
    longest = max(every, key=lambda function: function.lines)
    lines = [len(path.read_text().splitlines()) for path in modules()]
    print(f"modules {len(lines)}, lines {sum(lines)}, longest module {max(lines)}")
    print(f"files under {SHORT} lines {sum(n < SHORT for n in lines)}, of them doors of one line {lines.count(1)}")
    print(
        f"functions {len(every)}, median {statistics.median(function.lines for function in every):g} lines, "
        f"longest {longest.lines} ({longest.path.relative_to(ROOT)} {longest.name})"
    )
    print(f"functions that begin with a verb {100 * sum(function.does for function in every) / len(every):.0f} %")
    print(f"class names defined twice or more {len(duplicate_classes())}")
    for name, paths in duplicate_classes().items():
        print(f"    {name}: {', '.join(paths)}")
    print(f"constants in tuple assignments {len(tuple_constants())}")
    for place in tuple_constants():
        print(f"    {place}")


if __name__ == "__main__":
    write()
