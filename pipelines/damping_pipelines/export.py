"""``damping export``: records to universal files and other units, rankings and loads to CSV and Parquet, figures."""

from __future__ import annotations

import io
import json
import shutil
import subprocess
import sys
import tempfile
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import pandas as pd
from pydantic import Field, TypeAdapter, ValidationError

from damping.errors import AnalysisError, InputError
from damping.formats.quantity import SYSTEMS, convert_loads, convert_mode, convert_record, factors, unit
from damping.formats.uff_write import uff
from damping.records.mode import Mode, Units, describe_mode_to_toml, read_mode
from damping.records.reading import read_record
from damping.records.record import Record, record_to_csv
from damping.records.text import DEFAULT_MAX_SIZE, read_bytes
from damping_pipelines.decks import write_deck
from damping_pipelines.forms import LoadsForm, RankForm, tabulate_loads_rows, tabulate_ranking_rows
from damping_pipelines.store import refuse_inputs, refuse_twice, write_bytes, write_text
from damping_pipelines.terminal import console

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Largest ranking or loads form that is read, bytes (a form of a hundred candidates takes 50 000).
MAX_FORM_SIZE = 10_000_000
_UFF = (".uff", ".unv")
_EXPECTED = "a name ending in .uff, .unv, .csv or .parquet"


def export(
    source: Path,
    out: Path,
    *,
    units: str | None = None,
    given: str | None = None,
    mode: Path | None = None,
    mode_out: Path | None = None,
    text: bool = False,
    max_size: int = DEFAULT_MAX_SIZE,
) -> None:
    """Write a record, or a form ``rank/1`` or ``loads/1``, in the format that the name of ``out`` ends with.

    Args:
        source: a record (CSV) or a form (JSON, by its first character).
        out: ``.uff`` or ``.unv`` (records alone), ``.csv`` or ``.parquet``.
        units: ``si`` or ``us``: convert the record (and the mode) or the loads; None: as they are.
        given: ``si`` or ``us``: the units the record or the loads are in, where no mode names them.
        mode: mode whose ``[units]`` are those of the record or the loads.
        mode_out: where the converted mode goes.
        text: values of a universal file as text, not as bytes.

    Raises:
        InputError: bad options, a file that cannot be read, or units that are not known, are said to be two things,
            or of a ranking, which is not converted.
        AnalysisError: a record that a universal file cannot hold, or a mode that cannot be converted.
    """
    kind = out.suffix.lower()
    if kind not in (*_UFF, ".csv", ".parquet"):
        raise InputError(f"--out {out.name!r} is of no known format", expected=_EXPECTED)
    if text and kind not in _UFF:
        raise InputError(f"--text beside --out {out.name!r}", expected="a universal file: .uff or .unv")
    inputs = [path for path in (source, mode) if path is not None]
    refuse_inputs("--out", out, *inputs)
    refuse_inputs("--mode-out", mode_out, *inputs)
    refuse_twice({"--out": out, "--mode-out": mode_out})
    if read_bytes(source, max_size).lstrip()[:1] == b"{":
        _only_of_records(source, out, mode_out)
        _export_form(source, out, units, given, mode, max_size)
        return
    record = read_record(source, max_size=max_size)
    described = read_mode(mode) if mode else None
    names = _names(described, given)
    notes: list[str] = []
    if units is not None:
        by = factors(names, units, source=str(mode or source))
        record, notes = convert_record(record, by)
        names = Units(*SYSTEMS[units], "s")
        described = None if described is None else convert_mode(described, by, units)
    if mode_out is not None:
        _write_mode(described, units, mode_out)
    _write_record(record, names, out, notes, text=text)


def export_deck(source: Path, out: Path, code: str, max_size: int = MAX_FORM_SIZE) -> None:
    """Write the damping that a form ``curve/1``, ``loads/1`` or ``campaign/1`` holds for a structural code.

    Raises:
        InputError: an unknown code or a file that is no such form. AnalysisError: it holds no damping ratio.
    """
    refuse_inputs("--out", out, source)
    content = read_bytes(source, max_size)
    try:
        values = json.loads(content)
    except ValueError as error:
        raise InputError(str(error), file=source, expected="a form curve/1, loads/1 or campaign/1 (JSON)") from None
    if not isinstance(values, dict):
        raise InputError("no form", file=source, expected="a form curve/1, loads/1 or campaign/1 (JSON)")
    write_text(out, write_deck(code, content, values, str(source)))
    console().print(f"{out} written: damping for {code}")


def _names(mode: Mode | None, given: str | None) -> Units:
    """Units of the record: as stated, else of its mode."""
    if given is None:
        return mode.units if mode else Units()
    if given not in SYSTEMS:
        raise InputError(f"--from {given!r} is unknown", expected=" or ".join(SYSTEMS))
    stated = Units(*SYSTEMS[given], "s")
    if mode is not None:
        _agree(mode, stated, given)
    return stated


def _agree(mode: Mode, stated: Units, given: str) -> None:
    """InputError where the mode names other units than ``--from`` says."""
    for what, text in vars(mode.units).items():
        if not text:
            continue
        named, meant = unit(text, what=f"unit of {what}"), unit(getattr(stated, what))
        if (named.powers, named.factor) != (meant.powers, meant.factor):
            raise InputError(
                f"the mode has {what} in {text} and --from {given} says {getattr(stated, what)}",
                file=mode.source,
                expected="one of them, or both alike",
            )


def _only_of_records(source: Path, out: Path, mode_out: Path | None) -> None:
    """InputError for what is asked of a form and only a record has."""
    if out.suffix.lower() in _UFF:
        raise InputError("a ranking or loads are no record", file=source, expected="--out name.csv or name.parquet")
    if mode_out:
        raise InputError("--mode-out is for records, and this is a form", file=source, expected="no --mode-out")


def _export_form(
    source: Path, out: Path, units: str | None, given: str | None, mode: Path | None, max_size: int
) -> None:
    """A form as a table; loads in other units where they are asked for."""
    form = _form(source, max_size)
    table = _tabulate_rows(form)
    if units is None:
        _write_table(table, out)
        return
    if isinstance(form, RankForm):
        raise InputError(
            "--units is for records and loads, and this is a ranking, with coefficients of many dimensions",
            file=source,
            expected="a ranking of the converted record",
        )
    names = _names(read_mode(mode) if mode else None, given)
    _write_table(convert_loads(table, factors(names, units, source=str(mode or source))), out)
    show = console()
    show.print(f"{len(table)} rows written to {out}, {Units(*SYSTEMS[units], 's')}")
    if table["cautions"].any():
        show.print("- numbers within cautions are text and kept as they are")


def _write_mode(mode: Mode | None, units: str | None, out: Path) -> None:
    if mode is None or units is None:
        raise InputError("--mode-out without a mode to convert", file=out, expected="--mode MODE.toml and --units")
    write_text(out, describe_mode_to_toml(mode))


def _write_record(record: Record, names: Units, out: Path, notes: list[str], *, text: bool) -> None:
    if out.suffix.lower() in _UFF:
        content, lost = uff(record, names.length, names.force, binary=not text)
        write_bytes(out, content)
        notes = [*notes, *lost]
    else:
        _write_table(record.table, out)
    show = console()
    show.print(f"{len(record)} rows written to {out}, {names}")
    for note in notes:
        show.print(f"- {note}")


def _write_table(table: pd.DataFrame, out: Path) -> None:
    if out.suffix.lower() == ".parquet":
        write_bytes(out, to_parquet(table))
    else:
        write_text(out, record_to_csv(table))


def to_parquet(table: pd.DataFrame) -> bytes:
    """A table as a Parquet file."""
    import_module("pyarrow")  # of the extra [formats]: pandas says less clearly that it is not there
    buffer = io.BytesIO()
    table.to_parquet(buffer, engine="pyarrow", index=False)
    return buffer.getvalue()


def to_png(figure: Figure, *, dots_per_inch: int = 200) -> bytes:
    """A figure as a PNG image, the same bytes for the same figure."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dots_per_inch, metadata={"Software": None})
    return buffer.getvalue()


#: Endings of a picture's name.
PICTURES = (".svg", ".png")


def check_picture(path: Path) -> None:
    """InputError where the name of a picture ends with none of ``PICTURES``; before any work."""
    if path.suffix.lower() not in PICTURES:
        raise InputError(f"--plot {path.name!r} is of no known format", expected="a name ending in .svg or .png")


def write_picture(path: Path, figure: Any, title: str) -> None:
    """A figure as SVG or PNG, by the ending of its name; ``title``: its text alternative."""
    from damping.plots import to_svg  # noqa: PLC0415 - only drawing needs matplotlib

    check_picture(path)
    if path.suffix.lower() == ".png":
        write_bytes(path, to_png(figure))
    else:
        write_text(path, to_svg(figure, path.stem, title, title))
    print(f"{path} drawn", file=sys.stderr)


#: Names of the browser that prints, the first that is there.
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
#: What is printed of a page: its answer alone.
ANSWER_ALONE = """<style>@media print {
  main > section:not(#answer), nav, footer { display: none }
  body { zoom: 0.7 }
}</style></head>"""
#: Seconds that printing may take.
LONGEST_PRINT = 60


def print_answer(page: str) -> bytes:
    """The section ``answer`` of a page as PDF, by Chromium.

    Raises:
        AnalysisError: there is no Chromium, or it cannot print.
    """
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        raise AnalysisError(f"--pdf: none of {', '.join(BROWSERS)} is installed; print report.html from any browser")
    with tempfile.TemporaryDirectory() as folder:
        source, printed = Path(folder) / "report.html", Path(folder) / "report.pdf"
        write_text(source, page.replace("</head>", ANSWER_ALONE, 1))
        command = [browser, "--headless", "--no-sandbox", "--disable-gpu", "--no-pdf-header-footer"]
        done = subprocess.run(
            [*command, f"--print-to-pdf={printed}", source.as_uri()],
            capture_output=True,
            check=False,
            timeout=LONGEST_PRINT,
        )
        if done.returncode or not printed.exists():
            raise AnalysisError(f"--pdf: {browser} ended with {done.returncode} and no page")
        return printed.read_bytes()


_FORM: TypeAdapter[RankForm | LoadsForm] = TypeAdapter(Annotated[RankForm | LoadsForm, Field(discriminator="format")])


def tabulate_form(path: Path, max_size: int = MAX_FORM_SIZE) -> pd.DataFrame:
    """A form ``rank/1`` or ``loads/1`` as a table.

    A ranking has a row for each parameter of each force of each candidate; loads have one for each design force and
    law, the average over laws first (``model`` empty).

    Raises:
        InputError: the file is no such form; the first thing that is wrong is named.
    """
    return _tabulate_rows(_form(path, max_size))


def _tabulate_rows(form: RankForm | LoadsForm) -> pd.DataFrame:
    return tabulate_ranking_rows(form) if isinstance(form, RankForm) else tabulate_loads_rows(form)


def _form(path: Path, max_size: int) -> RankForm | LoadsForm:
    content = read_bytes(path, min(max_size, MAX_FORM_SIZE))
    try:
        return _FORM.validate_json(content)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"][1:]) or "the form"
        raise InputError(
            f"{place}: {first['msg']}", file=path, expected="a form rank/1 or loads/1, as --json writes it"
        ) from None
