"""Write the module table of ARCHITECTURE.md from the code: ``python tests/architecture/write_module_table.py``."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[2]
HEAD = "| where | what |\n|---|---|\n"
#: The arrow of imports, in which the table lists the parts of ``selection``.
ORDER = [
    *("errors", "arrays", "units", "forces", "records", "conditioning", "response", "regression"),
    *("posterior", "compare", "loads", "gap", "reproduction", "plots", "report", "api"),
]


def purpose(path: Path) -> str:
    """First line of a module's docstring, without the full stop."""
    text = ast.get_docstring(ast.parse(path.read_text()))
    assert text, f"{path} has no docstring"
    return text.splitlines()[0].rstrip(".")


def modules() -> dict[str, str]:
    """Every package and top-level module with its purpose."""
    parts = {}
    for top in ("selection", "pipelines"):
        parts |= {f"{top}/{p.parent.name}/": p for p in (ROOT / top).glob("*/__init__.py")}
        parts |= {f"{top}/{p.name}": p for p in (ROOT / top).glob("*.py") if p.name != "__init__.py"}
    return {name: purpose(parts[name]) for name in sorted(parts, key=position)}


def position(name: str) -> tuple[bool, int, str]:
    """Where a module stands in the table."""
    top, part = name.removesuffix(".py").split("/")[:2]
    return top == "pipelines", ORDER.index(part) if top == "selection" else 0, part


def write() -> None:
    """Replace the table at the end of ARCHITECTURE.md."""
    document = ROOT / "ARCHITECTURE.md"
    before = document.read_text().partition(HEAD)[0]
    rows = "".join(f"| `{name}` | {what} |\n" for name, what in modules().items())
    document.write_text(before + HEAD + rows)


if __name__ == "__main__":
    write()
