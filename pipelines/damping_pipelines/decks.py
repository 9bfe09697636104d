"""``damping export --to CODE``: damping for a structural code, one table per load level, median and lower bound.

Modes are numbered by frequency, the same at every level: a mode without damping at a level keeps its number there.

A code with one damping ratio per mode gets the ratio at the predicted resonant amplitude of each load level, where
force, amplitude and ratio agree: zeta = F/(2 M omega^2 A). Beside the median is the low end of the band (5 % for a
90 % band), with which a load is sized. It is the live block, at the largest tested or the largest requested level,
whichever has less damping; the others are comments. Codes that take coefficients get those of
c1 q' + c2 q' |q'| of equal dissipation,

    F = c1 omega A + (8/(3 pi)) c2 (omega A)^2     (Table 2.II, cases I and III),

by non-negative least squares over the load levels. They cannot represent damping that falls with amplitude. OpenFAST
takes them in N, m and s: they are converted if the form names its units; otherwise a comment says that it names none.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from math import pi
from pathlib import Path
from textwrap import wrap
from typing import Any, NamedTuple
from unicodedata import combining, normalize

import numpy as np

from damping.errors import AnalysisError, InputError
from damping.extrapolation.cautions import find_refusal
from damping.extrapolation.plan import ROUNDING
from damping.formats.quantity import find_powers
from damping.formats.quantity import unit as named_unit
from damping.records.mode import Units
from damping.report.page import fill_text
from damping_pipelines.folders import list_files, read_damping
from damping_pipelines.forms import CampaignForm, Damped, FormPart, LoadsForm
from damping_pipelines.manifest import digest
from damping_pipelines.store import check_outputs, write_text
from damping_pipelines.terminal import print_lines

#: Structural codes, each with how its comments begin.
COMMENTS = {"nastran": "$", "abaqus": "**", "ansys": "!", "opensees": "#", "openfast": "!"}
#: What a code does with a mode that has no ratio at a level; OpenSees takes no such level.
ABSENT = {
    "nastran": "the table gives it that of the modes beside it",
    "abaqus": "undamped unless you give it one",
    "ansys": "undamped unless you give it one",
}
BOUNDS = ("median", "low")  #: the damping ratios written of each load level
#: Ratio of the frequencies of a table's outermost points to those of the modes: constant damping to either side.
FLANK = 2.0
#: Largest relative error in damping that the form of the coefficients may leave unreported: bands of damping at tested
#: levels are as wide.
MOST_MISFIT = 0.05
#: SI unit of a linear coefficient by the powers of a force and its motion, and of a moment and its angle.
LINEAR_UNITS: dict[object, str] = {((1, 0, 0), (0, 1, 0)): "N/(m/s)", ((1, 1, 0), (0, 0, 0)): "N m/(rad/s)"}
COMMENT_WIDTH = 120  #: longest line of a comment, characters; Abaqus takes lines of 256
#: Reason for the live block if there are two candidates.
SAFER = "of the largest tested and the largest requested level, the one with less damping"
RATIOS_PER_LINE = 6  #: ratios on one line of an ANSYS ``MDAMP`` command


@dataclass(frozen=True)
class Point:
    """One mode at one load level: frequency in Hz, damping ratio (median and low), and a remark."""

    mode: str
    frequency: float
    median: float
    low: float
    force: float  #: at the resonance, as the amplitude; NaN where the form does not hold them
    amplitude: float
    remark: str
    tested: bool = True  #: not where the form says that it is outside the test
    at_force: bool = False  #: whether the ratios are those at the force, else at the amplitude


def export_deck(source: Path, out: Path, code: str, record: str | None) -> None:
    """Write for a structural code the damping of a form or folder (:func:`damping_pipelines.folders.read_damping`).

    The code is one of ``COMMENTS``, the text in ``decks.txt``. InputError: an unknown code, or a file that is no such
    form. AnalysisError: no level of the form has a damping ratio, or not what the code needs.
    """
    if code not in COMMENTS:
        raise InputError(f"--to {code!r} is unknown", expected=" or ".join(COMMENTS))
    check_outputs({"--out": out}, *list_files(source))
    form, content = read_damping(source, record)
    stated = (form.drive, form.units.force)
    drive, unit = (form.level_name, form.level_unit) if isinstance(form, CampaignForm) else stated
    if code == "openfast" and "base acceleration" in (form.drive, drive):
        raise AnalysisError(f"{source}: coefficients are of a force, and this form is of base acceleration")
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
    if code != "nastran":  # its tables go by frequency
        levels = {level: sorted(points, key=lambda point: number[point.mode]) for level, points in levels.items()}
    of_modes = product(modes.items() if code == "openfast" else (), BOUNDS)
    si = find_si(form.units)
    kept = ", ".join(filter(None, vars(form.units).values()))
    unconverted = f"OpenFAST takes N, m, s: these are the units of the form, {kept or 'which names none'}"
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
        "unconverted": unconverted,
        "absent": ABSENT,
        "missing": missing,
        "flank": FLANK,
        "wrap": partial(wrap, width=COMMENT_WIDTH, subsequent_indent="  "),
        "number": number,
        "split_runs": partial(split_runs, number),
    }
    write_text(out, to_ascii(fill_text(Path(__file__).with_suffix(".txt"), values)))
    misses = [f"{m}, {which}: {c}" for m, which, _, c in fitted if c.alone or abs(c.miss) > MOST_MISFIT]
    notes = [*missing, *([unconverted] if fitted and si is None else []), *misses]
    print_lines(f"{out} written: damping for {code}", notes)


def to_ascii(text: str) -> str:
    """The text in ASCII, which every code reads: accents are removed, other characters become "?"."""
    plain = normalize("NFKD", text.translate({ord("²"): "^2", ord("³"): "^3", ord("·"): "*"}))
    return "".join(c for c in plain if not combining(c)).encode("ascii", "replace").decode()


def _list_rows(form: Damped) -> list[tuple[str, float | None, dict[str, Any]]]:
    """Mode, level and values by name of every row."""
    if isinstance(form, CampaignForm):
        return [(mode.name, row.level, vars(row)) for mode in form.modes for row in mode.at]
    rows: Sequence[FormPart] = form.predictions if isinstance(form, LoadsForm) else form.rows
    return [(form.name, _find_force(vars(row)), vars(row)) for row in rows]


def _list_levels(form: Damped, drive: str, unit: str) -> tuple[dict[float, list[Point]], list[str]]:
    """The points of each level by frequency, one per mode, and notes on rows without a point.

    Of several rows of a mode at one level a tested one is preferred.
    """
    levels, missing = defaultdict[float, dict[str, Point]](dict), list[str]()
    for mode, level, row in _list_rows(form):
        point = _as_point(mode, row)
        if level is not None and point is not None:
            if row.get("tested") or mode not in levels[level]:
                levels[level][mode] = point
            continue
        at = f"amplitude {row['amplitude']}" if level is None else f"{drive} {level:g} {unit}".rstrip()
        missing.append(f"left out: {mode} at {at}: {find_refusal(row['cautions']) or 'no damping predicted'}")
    return {level: sorted(of.values(), key=lambda point: point.frequency) for level, of in levels.items()}, missing


class Live(NamedTuple):
    """Level and bound of the live block, the one that is no comment, and the reason for its choice."""

    level: float
    bound: str
    why: str


def choose_live(levels: Mapping[float, Sequence[Point]], number: Mapping[str, int], *, whole: bool) -> Live | None:
    """The live block: the low end at one level; None if there is no level.

    Of the largest tested and the largest requested level it is the one with less damping, in the geometric mean over
    the modes of both. ``whole``: only levels at which every mode has a damping ratio can be live.
    """
    written = [level for level, points in levels.items() if not whole or len(points) == number[points[-1].mode]]
    tested = [level for level in written if all(point.tested for point in levels[level])]
    ends = sorted({max(of) for of in (tested, written) if of})
    both = set.intersection(*({point.mode for point in levels[level]} for level in ends)) if ends else set()

    def weigh(level: float) -> float:
        return float(np.sum([np.log(point.low) for point in levels[level] if point.mode in both]))

    if not ends:
        return None
    alone = "the largest level tested" if tested else "the largest requested level, as no level is within the test"
    return Live(min(ends, key=weigh), BOUNDS[1], SAFER if len(ends) > 1 else alone)


def find_si(units: Units) -> tuple[float, float, str] | None:
    """N and m (N m and rad) in the units of force and length of a form, and the SI unit of AddBLin; None if unknown."""
    linear = LINEAR_UNITS.get((find_powers(units.force), find_powers(units.length)))
    return None if linear is None else (named_unit(units.force).factor, named_unit(units.length).factor, linear)


def split_runs(number: Mapping[str, int], points: Sequence[Point]) -> list[list[Point]]:
    """Runs of points with consecutive mode numbers, at most ``RATIOS_PER_LINE`` each."""
    runs = list[list[Point]]()
    for point in points:
        if not runs or len(runs[-1]) == RATIOS_PER_LINE or number[point.mode] != number[runs[-1][-1].mode] + 1:
            runs.append([])
        runs[-1].append(point)
    return runs


def _find_force(row: Mapping[str, Any]) -> float | None:
    """The force of a row; in ``loads/1`` for given amplitudes it is the median."""
    force, amplitude = row.get("force"), row.get("amplitude")
    return row.get("median") if force is None and amplitude is not None else force


def _as_point(mode: str, row: Mapping[str, Any]) -> Point | None:
    """A row as a point; None if it has no damping ratio, or one that is not positive."""
    ratio = row["damping_ratio"]
    if ratio is None or not all((value or 0.0) > 0.0 for value in (ratio.median, ratio.low, row["frequency"])):
        return None
    laws = ", ".join(
        f"{law.name} ({law.weight:.2f})" for law in row.get("by_model", ()) if (law.weight or 0.0) >= 0.005
    )
    times, is_tested = row.get("extrapolation_ratio"), row.get("tested")
    beyond = f"{times:.3g} times the tested force" if times else ""
    tested = {True: "within the test", False: "outside the test", None: ""}[is_tested]
    notched = next((caution for caution in row["cautions"] if caution.startswith("notched")), "")
    remark = "; ".join(part for part in (beyond or tested, notched, f"laws: {laws}" if laws else "") if part)
    resonant, amplitude = _find_force(row), row.get("amplitude")
    force = np.nan if resonant is None else resonant
    size = next((value for value in (amplitude, row.get("median")) if value is not None), np.nan)
    within = (times or 1.0) <= 1.0 + ROUNDING if is_tested is None else is_tested
    is_asked = amplitude is None or row.get("amplitude_low") not in (None, amplitude)
    at_force = row.get("force") is not None and is_asked
    return Point(mode, row["frequency"], ratio.median, ratio.low, force, size, remark, within, at_force)


@dataclass(frozen=True)
class Coefficients:
    """c1 and c2 of one mode at one bound, and their largest error; in N, m and s if the form names its units."""

    linear: float  #: c1
    quadratic: float  #: c2
    miss: float  #: their damping over that of the form, less 1, at the level of the largest error
    force: float  #: there
    equivalent: float  #: F/(omega A) of the form there, the c1 that alone would fit that level
    falls: bool  #: whether F/(omega A) is smaller at the largest amplitude than at the smallest
    unit: str = ""  #: of forces
    alone: bool = False  #: whether there is only one level, at which any ratio of the two fits

    def __str__(self) -> str:
        at = f"{self.force:g} {self.unit}".rstrip()
        if self.alone:
            inseparable = f"one level (force {at}) does not separate linear from quadratic damping"
            return f"{inseparable}: right only at its amplitude"
        text = f"differs from the damping of the form by up to {100.0 * abs(self.miss):.2g} % (at force {at}"
        if abs(self.miss) <= MOST_MISFIT:
            return f"{text})"
        why = "damping that falls as the amplitude grows" if self.falls else "this shape of the damping"
        return f"{text}, where AddBLin alone would be {self.equivalent:.3g}): this form cannot follow {why}"


def fit_coefficients(
    points: Sequence[Point], which: str, unit: str = "", si: tuple[float, float, str] | None = None
) -> Coefficients:
    """c1 and c2 >= 0 of c1 q' + c2 q' |q'| fitted to the forces of the points at their amplitudes (see the module).

    ``si``: as of :func:`find_si`; coefficients are then in SI.

    At the low bound of damping the amplitude is A median/low where the form was asked for forces, and the force is
    F low/median where it was asked for amplitudes: each keeps zeta = F/(2 M omega^2 A). AnalysisError: the form holds
    no forces and amplitudes.
    """
    from scipy.optimize import nnls  # noqa: PLC0415 - slow to import, and one deck needs it

    omega = 2.0 * pi * np.array([point.frequency for point in points])
    newtons, metres, _ = si or (1.0, 1.0, "")
    share = np.array([getattr(point, which) / point.median for point in points])
    at_force = np.array([point.at_force for point in points])
    A = np.array([metres * point.amplitude for point in points]) / np.where(at_force, share, 1.0)
    F = np.array([newtons * point.force for point in points]) * np.where(at_force, 1.0, share)
    if not np.all((A > 0.0) & (F > 0.0)):
        form = "a form loads/1 or curve/1 (of a campaign: damping curve of modes/NAME/record.csv in its folder)"
        raise AnalysisError(f"coefficients need force and amplitude of each level: {form}")
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
