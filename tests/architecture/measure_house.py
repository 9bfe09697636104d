"""The size and shape of the house in numbers: ``python tests/architecture/measure_house.py``."""

from __future__ import annotations

import ast
import statistics
from collections import defaultdict
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
HOUSES = ("damping", "damping_pipelines", "damping_reed1970", "damping_validation")
#: A file below this many lines is short.
SHORT = 40
#: Short files allowed, doors of packages counted.
MOST_SHORT = 20
#: Longest function allowed, lines.
LONGEST = 60
#: First words of functions that do something. A quantity keeps its noun: ``energy_factor``, ``log_likelihood``.
VERBS = frozenset((Path(__file__).parent / "verbs.txt").read_text().split())


@dataclass(frozen=True)
class Function:
    """A function of a module: where, its name and the lines of its body, docstring included."""

    path: Path
    name: str
    lines: int

    @property
    def does(self) -> bool:
        """Whether its name begins with a verb."""
        return self.name.lstrip("_").split("_")[0] in VERBS


@cache
def parse(path: Path) -> ast.Module:
    """The syntax of a module."""
    return ast.parse(path.read_text())


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
        Function(path, node.name, (node.end_lineno or node.lineno) - node.body[0].lineno + 1)
        for node in ast.walk(parse(path))
        if isinstance(node, ast.FunctionDef)
        and not node.name.startswith("__")
        and not any(isinstance(d, ast.Name) and "property" in d.id for d in node.decorator_list)
    ]


def duplicate_classes() -> dict[str, list[str]]:
    """Class names that are defined more than once, with the modules that define them."""
    found: dict[str, list[str]] = defaultdict(list)
    for path in modules():
        for node in ast.walk(parse(path)):
            if isinstance(node, ast.ClassDef):
                found[node.name].append(str(path.relative_to(ROOT)))
    return {name: paths for name, paths in sorted(found.items()) if len(paths) > 1}


def tuple_constants() -> list[str]:
    """Places where constants share one assignment, ``A, B = 1, 2``: each wants its own name, unit and reason."""
    return [
        f"{path.relative_to(ROOT)}:{node.lineno} {ast.unparse(node)}"
        for path in modules()
        for node in parse(path).body
        if isinstance(node, ast.Assign)
        and isinstance(node.targets[0], ast.Tuple)
        and any(isinstance(name, ast.Name) and name.id.isupper() for name in node.targets[0].elts)
    ]


def file_lines() -> dict[Path, int]:
    """Lines of every module."""
    return {path: len(path.read_text().splitlines()) for path in modules()}


def write() -> None:
    """Print the measures."""
    every = [function for path in modules() for function in functions(path)]
    longest = max(every, key=lambda function: function.lines)
    lines = list(file_lines().values())
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
