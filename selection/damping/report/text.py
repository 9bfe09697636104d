"""Texts that stand in files, filled with numbers: the blocks and sections of a page.

A text is a file beside the module that fills it, a jinja2 template. After filling, an empty line ends a block. A block
is a paragraph unless its first line begins with one of

- ``# id: Title``: a section, as far as the next one,
- ``##``: a heading,
- ``*``: a list, an item from each ``*`` to the next,
- ``[lead]``: a paragraph that stands out,
- ``[callout] title`` with a list below: what is not to be missed,
- ``[fold] summary``: what follows as far as ``[end]``, behind a line,
- ``[table NAME] caption`` or any other word in such brackets: what the module gives for it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, StrictUndefined, Template

from damping import report as words
from damping.report.page import Block, Callout, Fold, Heading, List, Section, Text

#: Functions that a text may use: numbers and lists in words.
_WORDS = {
    "between": words.format_between,
    "count": words.count,
    "counted": words.format_counted,
    "joined": words.format_joined,
    "number": words.number,
    "numbers": words.format_numbers,
    "percent": words.format_percent,
    "points_text": words.format_points_text,
    "share": words.format_share,
    "signed": words.format_signed,
}
#: Stands before a value that begins with ``[``, ``#`` or ``*`` until blocks are cut: those are words of the text alone.
_VALUE = "\x00"
_DIRECTIVE = re.compile(r"\[(\w+) ?([^\]]*)\] ?(.*)", re.DOTALL)
#: Blocks for a directive: its word, its name, and what follows on its lines.
Take = Callable[[str, str, str], Iterable[Block]]


def write_blocks(text: Path, values: Mapping[str, Any], take: Take = lambda kind, name, rest: []) -> list[Block]:
    """The blocks of a text filled with values; ``take`` gives those of its own directives."""
    return list(_build_blocks(_cut_parts(_fill(text, values)), take))


def write_sections(text: Path, values: Mapping[str, Any], parts: Mapping[str, Block] | None = None) -> list[Section]:
    """The sections of a text filled with values.

    Its directives name ``parts`` and give them their captions; one that is not there leaves nothing.
    """

    def take(kind: str, name: str, rest: str) -> list[Block]:
        part: Any = (parts or {}).get(name)
        return [] if part is None else [replace(part, caption=join_lines(rest)) if rest else part]

    sections = []
    for section in re.split(r"^# ", _fill(text, values), flags=re.MULTILINE)[1:]:
        head, _, body = section.partition("\n")
        key, _, title = head.partition(": ")
        sections.append(Section(key, title, list(_build_blocks(_cut_parts(body), take))))
    return sections


@cache
def _template(text: Path) -> Template:
    # the page escapes what it shows
    environment = Environment(undefined=StrictUndefined, trim_blocks=True, finalize=_join_value)
    return environment.from_string(text.read_text("utf-8"), globals=_WORDS)


def fill_text(text: Path, values: Mapping[str, Any]) -> str:
    """A text filled with values, none of which begins a line of its own."""
    return _fill(text, values).replace(_VALUE, "")


def _fill(text: Path, values: Mapping[str, Any]) -> str:
    return _template(text).render(**values)


def _cut_parts(filled: str) -> Iterator[str]:
    return (part.strip("\n") for part in re.split(r"\n{2,}", filled.strip("\n")) if part)


def _build_blocks(parts: Iterator[str], take: Take) -> Iterator[Block]:
    """Blocks as far as the end of the text or of a fold."""
    for part in parts:
        if part.startswith("## "):
            yield Heading(join_lines(part.removeprefix("## ")))
        elif part.startswith("* "):
            yield List(_list_items(part))
        elif directive := _DIRECTIVE.fullmatch(part):
            kind, name, rest = directive.groups()
            match kind:
                case "end":
                    return
                case "fold":
                    yield Fold(join_lines(rest), list(_build_blocks(parts, take)))
                case "lead":
                    yield Text(join_lines(rest), lead=True)
                case "callout":
                    yield Callout(join_lines(rest.partition("\n* ")[0]), _list_items(rest))
                case _:
                    yield from take(kind, name, rest)
        else:
            yield Text(join_lines(part))


def _list_items(part: str) -> list[str]:
    return [join_lines(item) for item in re.split(r"(?:^|\n)\* ", part)[1:]]


def join_lines(text: str) -> str:
    """A text in one line."""
    return re.sub(r" *\n *", " ", text).replace(_VALUE, "")


def _join_value(value: object) -> str:
    """A value in one line that begins no block of its own."""
    line = join_lines(str(value))
    return _VALUE + line if line.startswith(("[", "#", "*")) else line
