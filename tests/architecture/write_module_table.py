"""Write the module table of ARCHITECTURE.md from the code: ``python tests/architecture/write_module_table.py``."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[2]
HEAD = "| where | what |\n|---|---|\n"
#: The arrow of imports, in which the table lists the parts of the library.
ORDER = [
    *("errors", "arrays", "forces", "effects", "records", "signals", "predict", "regression"),
    *("infer", "ranking", "extrapolation", "gap", "formats", "campaign", "plots", "report", "api"),
]
HOUSES = (
    "selection/damping",
    "pipelines/damping_pipelines",
    "pipelines/damping_reed1970",
    "pipelines/damping_validation",
)


def purpose(path: Path) -> str:
    """First line of a module's docstring, without the full stop."""
    text = ast.get_docstring(ast.parse(path.read_text()))
    assert text, f"{path} has no docstring"
    return text.splitlines()[0].rstrip(".")


def modules() -> dict[str, str]:
    """Every house, and its packages and top-level modules, with its purpose."""
    parts: dict[str, Path] = {}
    for house in HOUSES:
        parts[f"{house}/"] = ROOT / house / "__init__.py"
        inside = {f"{house}/{p.parent.name}/": p for p in (ROOT / house).glob("*/__init__.py")}
        inside |= {f"{house}/{p.name}": p for p in (ROOT / house).glob("*.py") if p.name != "__init__.py"}
        parts |= {name: inside[name] for name in sorted(inside, key=position)}
    return {name: purpose(path) for name, path in parts.items()}


def position(name: str) -> tuple[int, str]:
    """Where a module stands in the table of its house."""
    part = name.removesuffix(".py").rstrip("/").rpartition("/")[2]
    return ORDER.index(part) if part in ORDER and "damping/" in name else len(ORDER), part


def write() -> None:
    """Replace the table at the end of ARCHITECTURE.md."""
    document = ROOT / "ARCHITECTURE.md"
    before = document.read_text().partition(HEAD)[0]
    rows = "".join(f"| `{name}` | {what} |\n" for name, what in modules().items())
    document.write_text(before + HEAD + rows)


if __name__ == "__main__":
    write()
