"""How Sphinx makes the documentation: Markdown in, pages out; ``make docs``.

``{{ commands }}``, ``{{ forces }}`` and ``{{ effects }}`` in a page are what these say of themselves.
"""

from __future__ import annotations

import inspect
import re

import typer
from sphinx.application import Sphinx

from damping.effects import CATALOGUE as EFFECTS
from damping.effects import FOREIGN
from damping.forces import CATALOGUE, list_parameter_names
from damping_pipelines.cli import app as cli

project = "Damping models from vibration tests"
author = "the authors of damping-selection"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
autodoc_preserve_defaults = True  # progress=silent, not where that function lies in memory
autodoc_typehints = "none"  # names of other modules; what an argument is, the texts say
myst_enable_extensions = ["deflist"]
myst_heading_anchors = 3
smartquotes = False  # q' is the derivative of q
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = "Damping models you can stake a design on"
html_show_sphinx = False
html_show_copyright = False
html_copy_source = False


def commands() -> str:
    """``--help`` of every command."""
    group = typer.main.get_command(cli)
    parts = []
    for name, command in group.commands.items():
        context = typer.Context(
            command,
            info_name=f"damping {name}",
            terminal_width=90,
            max_content_width=90,
            help_option_names=["-h", "--help"],
        )
        parts.append(f"## damping {name}\n\n```text\n{command.get_help(context)}\n```\n")
    return "\n".join(parts)


def forces() -> str:
    """A table of the catalogue, and what each force says of itself."""
    rows = ["| name | g | parameters | energy per cycle |", "|---|---|---|---|"]
    for name, force in CATALOGUE.items():
        powers = getattr(force, "energy_exponents", None)
        energy = "A^{:g} ω^{:g}".format(*powers) if isinstance(powers, tuple) else "by its parameters"
        formula = str(force.formula).replace("|", r"\|")
        rows.append(f"| `{name}` | `{formula}` | {', '.join(list_parameter_names(name))} | {energy} |")
    said = [f"`{name}`\n: {' '.join((inspect.getdoc(force) or '').split())}\n" for name, force in CATALOGUE.items()]
    return "\n".join(rows) + "\n\n" + "\n".join(said)


def effects() -> str:
    """A table of the library of the gap diagnosis, and the causes that have no name in it."""
    rows = ["| name | kind | what it says | parameters |", "|---|---|---|---|"]
    for name, effect in EFFECTS.items():
        words = (shape.label if shape.label.startswith(shape.name) else shape.name for shape in effect.shapes)
        shapes = re.sub(r"(\w+_)1(, \1\d)+", r"\1N (of sweep N)", ", ".join(words))
        rows.append(f"| `{name}` | {effect.kind} | {effect.sentence} | {shapes} |".replace("|q|", r"\|q\|"))
    unnamed = [f"- {effect.sentence}" for effect in FOREIGN.values()]
    return "\n".join([*rows, "", "Fitted beside them, without a name as an answer:", "", *unnamed])


def fill(app: Sphinx, name: str, source: list[str]) -> None:
    """Put the generated parts into a page."""
    for key, text in (("{{ commands }}", commands), ("{{ forces }}", forces), ("{{ effects }}", effects)):
        if key in source[0]:
            source[0] = source[0].replace(key, text())


def setup(app: Sphinx) -> None:
    """Called by Sphinx."""
    app.connect("source-read", fill)
