"""``damping export --to CODE``: damping for a structural code, one table a load level, median and lower bound.

Modes are numbered by frequency, the same at every level: one that has no damping at a level keeps its number there.

A code that knows one damping ratio a mode gets that of the predicted resonant amplitude at each load level, where
force, amplitude and ratio agree: zeta = F/(2 M omega^2 A). Beside the median stands the low end of the band (5 % of
90 %): the one a load is sized with, and so the block that is live, at the largest level of the test or the largest
that was asked for, whichever has less damping; the others are comments. Codes that take coefficients get those of
c1 q' + c2 q' |q'| of equal dissipation,

    F = c1 omega A + (8/(3 pi)) c2 (omega A)^2     (Table 2.II, cases I and III),

by non-negative least squares over the load levels. It follows no damping that falls as the amplitude grows. OpenFAST
takes them in N, m and s: where the form names its units they are converted, else a comment says that none is named.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from math import pi
from pathlib import Path
from textwrap import wrap
from typing import NamedTuple
from unicodedata import combining, normalize

import numpy as np

from damping.errors import AnalysisError, InputError
from damping.extrapolation.near import ROUNDING
from damping.formats.quantity import find_powers
from damping.formats.quantity import unit as named_unit
from damping.records.text import read_bytes
from damping.report.page import fill_text
from damping_pipelines.forms import MAX_FORM_SIZE, DampedRow, DampingForm, read_form
from damping_pipelines.manifest import digest
from damping_pipelines.store import check_outputs, write_text
from damping_pipelines.terminal import tell

#: Structural codes, each with how its comments begin.
COMMENTS = {"nastran": "$", "abaqus": "**", "ansys": "!", "opensees": "#", "openfast": "!"}
#: The damping ratios written of each load level.
BOUNDS = ("median", "low")
#: Ratio of the frequencies of a table's outermost points to those of the modes: constant damping to either side.
FLANK = 2.0
#: Coefficients that miss the damping of a level by a larger share are said to be of a form that cannot follow it: bands
#: of damping at tested levels are as wide.
MOST_MISFIT = 0.05
#: Characters of a comment from which on it goes on in another line: Abaqus takes lines of 256.
COMMENT_WIDTH = 120
#: Why a block is live where two could be.
SAFER = "of the largest tested and the largest requested level, the one with less damping"
#: Ratios on one line of an ANSYS ``MDAMP`` command.
RATIOS_PER_LINE = 6


@dataclass(frozen=True)
class Point:
    """One mode at one load level: frequency in Hz, damping ratio (median and low), and the words that describe it."""

    mode: str
    frequency: float
    median: float
    low: float
    force: float  #: at the resonance, as the amplitude; NaN where the form does not hold them
    amplitude: float
    remark: str
    tested: bool = True  #: not where the form says that it is beyond the test


def export_deck(source: Path, out: Path, code: str) -> None:
    """Write the damping that a form ``curve/1``, ``loads/1`` or ``campaign/1`` holds for a structural code.

    The code is one of ``COMMENTS``, the text in ``decks.txt``. InputError: an unknown code, or a file that is no such
    form. AnalysisError: no level of the form has a damping ratio, or not what the code needs.
    """
    if code not in COMMENTS:
        raise InputError(f"--to {code!r} is unknown", expected=" or ".join(COMMENTS))
    check_outputs({"--out": out}, source)
    content = read_bytes(source, MAX_FORM_SIZE)
    form = read_form(DampingForm, content, source, "a form curve/1, loads/1 or campaign/1 (JSON)")
    drive, unit = (form.level_name, form.level_unit) if form.modes else (form.drive, form.units.get("force", ""))
    if code == "openfast" and form.drive != "force":
        raise AnalysisError(f"{source}: coefficients are of a force, and this form is of {form.drive}")
    levels, missing = _list_levels(form, drive, unit)
    if not levels:
        why = "; ".join(missing) or "write it with damping curve or extrapolate"
        raise AnalysisError(f"{source}: no level holds a damping ratio: {why}")
    modes = defaultdict[str, list[Point]](list)
    for points in levels.values():
        for point in points:
            modes[point.mode].append(point)
    by_frequency = sorted(modes, key=lambda mode: modes[mode][0].frequency)
    number = {mode: i + 1 for i, mode in enumerate(by_frequency)}
    of_modes = product(modes.items() if code == "openfast" else (), BOUNDS)
    si = find_si(form.units)
    fitted = [(mode, which, points, fit_coefficients(points, which, unit, si)) for (mode, points), which in of_modes]
    values = {
        "code": code,
        "comment": COMMENTS[code],
        "form": form,
        "digest": digest(content),
        "levels": list(product(levels.items(), BOUNDS)),
        "live": choose_live(levels, number, whole=code == "opensees"),
        "drive": drive,
        "unit": unit,
        "fitted": fitted,
        "si": si,
        "missing": missing,
        "flank": FLANK,
        "wrap": partial(wrap, width=COMMENT_WIDTH, subsequent_indent="  "),
        "number": number,
        "split_runs": partial(split_runs, number),
    }
    write_text(out, to_ascii(fill_text(Path(__file__).with_suffix(".txt"), values)))
    misses = (f"{m}, {which}: {c}" for m, which, _, c in fitted if c.alone or abs(c.miss) > MOST_MISFIT)
    tell(f"{out} written: damping for {code}", (*missing, *misses))


def to_ascii(text: str) -> str:
    """The text in the characters that every code reads: accents are left out, what has no such character is "?"."""
    plain = normalize("NFKD", text.translate({ord("²"): "^2", ord("³"): "^3", ord("·"): "*"}))
    return "".join(c for c in plain if not combining(c)).encode("ascii", "replace").decode()


def _list_levels(form: DampingForm, drive: str, unit: str) -> tuple[dict[float, list[Point]], list[str]]:
    """The points of each level by frequency, one a mode, and what is said of rows that have none.

    Of several rows of a mode at one level it is one that was tested, where one was.
    """
    of_modes = [(mode.name, row.level, row) for mode in form.modes for row in mode.at]
    levels, missing = defaultdict[float, dict[str, Point]](dict), list[str]()
    for mode, level, row in of_modes or [("mode", _find_force(row), row) for row in (*form.predictions, *form.rows)]:
        point = _as_point(mode, row)
        if level is not None and point is not None:
            if row.tested or mode not in levels[level]:
                levels[level][mode] = point
            continue
        at = f"amplitude {row.amplitude}" if level is None else f"{drive} {level:g} {unit}".rstrip()
        why = next((caution for caution in row.cautions if caution.startswith("no prediction")), "no damping predicted")
        missing.append(f"left out: {mode} at {at}: {why}")
    return {level: sorted(of.values(), key=lambda point: point.frequency) for level, of in levels.items()}, missing


class Live(NamedTuple):
    """The level and bound of the block that stands as no comment, and why it is this one."""

    level: float
    bound: str
    why: str


def choose_live(levels: Mapping[float, Sequence[Point]], number: Mapping[str, int], *, whole: bool) -> Live | None:
    """The block that stands as no comment: a low end.

    Of the largest level within the test and the largest that was asked for it is the one with less damping, in the
    geometric mean of the modes that both have. ``whole``: only levels at which no mode lacks its damping can be
    written; None where there is none.
    """
    written = [level for level, points in levels.items() if not whole or len(points) == number[points[-1].mode]]
    tested = [level for level in written if all(point.tested for point in levels[level])]
    ends = sorted({max(of) for of in (tested, written) if of})
    both = set.intersection(*({point.mode for point in levels[level]} for level in ends)) if ends else set()

    def weigh(level: float) -> float:
        return float(np.sum([np.log(point.low) for point in levels[level] if point.mode in both]))

    if not ends:
        return None
    alone = "the largest level tested" if tested else "the largest asked for, as no level is within the test"
    return Live(min(ends, key=weigh), BOUNDS[1], SAFER if len(ends) > 1 else alone)


def find_si(units: Mapping[str, str]) -> tuple[float, float] | None:
    """N and m in the units of force and length of a form; None where it names none of these."""
    force, length = (units.get(what, "") for what in ("force", "length"))
    if (find_powers(force), find_powers(length)) != ((1, 0, 0), (0, 1, 0)):
        return None
    return named_unit(force).factor, named_unit(length).factor


def split_runs(number: Mapping[str, int], points: Sequence[Point]) -> list[list[Point]]:
    """The points whose modes follow each other by ``number``, ``RATIOS_PER_LINE`` together at most."""
    runs = list[list[Point]]()
    for point in points:
        if not runs or len(runs[-1]) == RATIOS_PER_LINE or number[point.mode] != number[runs[-1][-1].mode] + 1:
            runs.append([])
        runs[-1].append(point)
    return runs


def _find_force(row: DampedRow) -> float | None:
    """The force of a row; a prediction of ``loads/1`` that was asked by amplitude holds it as its median."""
    return row.median if row.force is None and row.amplitude is not None else row.force


def _as_point(mode: str, row: DampedRow) -> Point | None:
    """A row as a point; None where it predicts no damping."""
    ratio = row.damping_ratio
    if ratio is None or ratio.median is None or ratio.low is None or row.frequency is None:
        return None
    said = {str(law["name"]): f"{float(law.get('weight') or 0.0):.2f}" for law in row.by_model}
    laws = ", ".join(f"{name} ({weight})" for name, weight in said.items() if float(weight) > 0.0)
    beyond = f"{row.extrapolation_ratio:.3g} times the tested force" if row.extrapolation_ratio else ""
    tested = {True: "within the test", False: "beyond the test", None: ""}[row.tested]
    notched = next((said for said in row.cautions if said.startswith("notched")), "")
    remark = "; ".join(part for part in (beyond or tested, notched, f"laws: {laws}" if laws else "") if part)
    resonant = _find_force(row)
    force = np.nan if resonant is None else resonant
    amplitude = next((value for value in (row.amplitude, row.median) if value is not None), np.nan)
    within = (row.extrapolation_ratio or 1.0) <= 1.0 + ROUNDING if row.tested is None else row.tested
    return Point(mode, row.frequency, ratio.median, ratio.low, force, amplitude, remark, within)


@dataclass(frozen=True)
class Coefficients:
    """c1 (``linear``) and c2 (``quadratic``) of one mode at one bound, and where they miss its damping most.

    Coefficients, and ``equivalent``, are in N, m and s where the form names its units.

    ``miss``: their damping there over that of the form, less 1; ``force`` of that level; ``equivalent``: F/(omega A) of
    the form there, the c1 that alone would do; ``falls``: that it is less at the largest amplitude than at the least.
    ``unit``: of forces. ``alone``: of one level, where any share of the two carries its force.
    """

    linear: float
    quadratic: float
    miss: float
    force: float
    equivalent: float
    falls: bool
    unit: str = ""
    alone: bool = False

    def __str__(self) -> str:
        at = f"{self.force:g} {self.unit}".rstrip()
        if self.alone:
            return (
                f"one level (force {at}) does not separate linear from quadratic damping: right only at its amplitude"
            )
        text = f"differs from the damping of the form by up to {100.0 * abs(self.miss):.2g} % (at force {at}"
        if abs(self.miss) <= MOST_MISFIT:
            return f"{text})"
        why = "damping that falls as the amplitude grows" if self.falls else "this shape of the damping"
        return f"{text}, where AddBLin alone would be {self.equivalent:.3g}): this form cannot follow {why}"


def fit_coefficients(
    points: Sequence[Point], which: str, unit: str = "", si: tuple[float, float] | None = None
) -> Coefficients:
    """c1 and c2 >= 0 of c1 q' + c2 q' |q'| that carry the forces of the points at their amplitudes (see the module).

    ``si``: N and m in the units of force and amplitude, in which coefficients then are.

    The low bound of damping is the force that the low ratio means: F low/median. AnalysisError: the form holds no
    forces and amplitudes.
    """
    from scipy.optimize import nnls  # noqa: PLC0415 - slow to import, and one deck needs it

    omega = 2.0 * pi * np.array([point.frequency for point in points])
    newtons, metres = si or (1.0, 1.0)
    A = np.array([metres * point.amplitude for point in points])
    F = np.array([newtons * point.force * getattr(point, which) / point.median for point in points])
    if not np.all(np.isfinite(A) & np.isfinite(F)):
        raise AnalysisError("coefficients need force and amplitude of each level: a form loads/1 or curve/1")
    columns = np.stack([omega * A, 8.0 / (3.0 * pi) * (omega * A) ** 2], axis=1) / F[:, None]
    scale = columns.max(axis=0)
    linear, quadratic = nnls(columns / scale, np.ones(len(F)))[0] / scale
    misses, equivalent = columns @ [linear, quadratic] - 1.0, F / (omega * A)
    worst = int(np.argmax(np.abs(misses)))
    return Coefficients(
        float(linear),
        float(quadratic),
        miss=float(misses[worst]),
        force=points[worst].force,
        equivalent=float(equivalent[worst]),
        falls=bool(equivalent[np.argmax(A)] < equivalent[np.argmin(A)]),
        unit=unit,
        alone=len(points) == 1,
    )
