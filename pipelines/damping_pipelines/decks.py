"""``damping export --to CODE``: damping for a structural code, one table a load level, median and lower bound.

A code that knows one damping ratio a mode gets that of the predicted resonant amplitude at each load level, where
force, amplitude and ratio agree: zeta = F/(2 M omega^2 A). Beside the median stands the low end of the band (5 % of
90 %): the one a load is sized with. Codes that take coefficients get those of c1 q' + c2 q' |q'| of equal dissipation,

    F = c1 omega A + (8/(3 pi)) c2 (omega A)^2     (Table 2.II, cases I and III),

by non-negative least squares over the load levels.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from math import pi

import numpy as np

from damping.errors import AnalysisError, InputError
from damping_pipelines.forms import DampedRow, DampingForm

#: Ratio of the frequencies of a table's outermost points to those of the modes: constant damping to either side.
FLANK = 2.0
#: Ratios on one line of an ANSYS ``MDAMP`` command.
RATIOS_A_LINE = 6


@dataclass(frozen=True)
class Point:
    """One mode at one load level: frequency in Hz, damping ratio (median and low), and the words that describe it.

    ``force`` and ``amplitude`` are those of the resonance, NaN where the form does not hold them.
    """

    mode: str
    frequency: float
    median: float
    low: float
    force: float
    amplitude: float
    remark: str


@dataclass(frozen=True)
class LoadLevel:
    """A load level: its label and the modes there, by frequency."""

    label: str
    points: tuple[Point, ...]


def write_deck(code: str, content: bytes, form: DampingForm, source: str) -> str:
    """The damping of a form as text for a structural code.

    Args:
        code: one of ``CODES``. content: the form as it was read, whose hash goes into the comments. source: its name.

    InputError: an unknown code. AnalysisError: no level of the form has a damping ratio, or not what the code needs.
    """
    if code not in CODES:
        raise InputError(f"--to {code!r} is unknown", expected=" or ".join(CODES))
    levels = _list_levels(form)
    if not levels:
        raise AnalysisError(f"{source}: no level holds a damping ratio; write it with damping curve or extrapolate")
    digest = hashlib.sha256(content).hexdigest()
    head = [
        f"damping for {code}, from {form.format}, SHA-256 {digest}",
        f"low: the lower end of the {form.level:g} band",
    ]
    write, comment = CODES[code]
    return "".join(f"{comment} {line}\n" for line in head) + write(levels, comment)


def _list_levels(form: DampingForm) -> list[LoadLevel]:
    """The load levels with a damping ratio, in the order of the form."""
    if form.modes:
        named = [(row.level, _as_point(mode.name, row)) for mode in form.modes for row in mode.at]
    else:
        named = [(_find_force(row), _as_point("mode", row)) for row in (*form.predictions, *form.rows)]
    levels: dict[float, list[Point]] = {}
    for value, point in named:
        if value is not None and point is not None:
            levels.setdefault(value, []).append(point)
    return [
        LoadLevel(f"level {value:g}", tuple(sorted(points, key=lambda point: point.frequency)))
        for value, points in levels.items()
    ]


def _find_force(row: DampedRow) -> float | None:
    """The force of a row; a prediction of ``loads/1`` that was asked by amplitude holds it as its median."""
    return row.median if row.force is None and row.amplitude is not None else row.force


def _as_point(mode: str, row: DampedRow) -> Point | None:
    """A row as a point; None where it predicts no damping."""
    ratio = row.damping_ratio
    if ratio is None or ratio.median is None or ratio.low is None or row.frequency is None:
        return None
    laws = ", ".join(f"{law['name']} ({float(law['weight']):.2f})" for law in row.by_model if law.get("weight"))
    beyond = f"{row.extrapolation_ratio:.3g} times the tested force" if row.extrapolation_ratio else ""
    tested = {True: "within the test", False: "beyond the test", None: ""}[row.tested]
    remark = "; ".join(part for part in (beyond or tested, f"laws: {laws}" if laws else "") if part)
    resonant = _find_force(row)
    force = np.nan if resonant is None else resonant
    amplitude = next((value for value in (row.amplitude, row.median) if value is not None), np.nan)
    return Point(mode, row.frequency, ratio.median, ratio.low, force, amplitude, remark)


def _describe(level: LoadLevel, which: str, comment: str) -> list[str]:
    """Comments of a table: level, which bound, and each mode."""
    modes = []
    for point in level.points:
        remark = f"; {point.remark}" if point.remark else ""
        modes.append(f"{comment}   {point.mode}: {point.frequency:.6g} Hz{remark}")
    return [f"{comment} {level.label}, {which}", *modes]


def _each_table(levels: Sequence[LoadLevel]) -> list[tuple[int, LoadLevel, str, list[float]]]:
    """Number, level, name of the bound and ratios of every table: median and low of each level."""
    tables = [(level, which) for level in levels for which in ("median", "low")]
    return [
        (number, level, which, [getattr(point, which) for point in level.points])
        for number, (level, which) in enumerate(tables, start=1)
    ]


def _write_nastran(levels: Sequence[LoadLevel], comment: str) -> str:
    """TABDMP1 entries of critical damping in large fields of 16 characters; ``SDAMPING = ID`` selects one."""
    lines: list[str] = []
    for number, level, which, ratios in _each_table(levels):
        f = [point.frequency for point in level.points]
        pairs = [(f[0] / FLANK, ratios[0]), *zip(f, ratios, strict=True), (f[-1] * FLANK, ratios[-1])]
        fields = [f"{value:.9E}".rjust(16) for pair in pairs for value in pair] + ["ENDT".rjust(16)]
        lines += [*_describe(level, which, comment), f"TABDMP1*{number:>16d}{'CRIT':>16}", "*"]
        lines += ["*".ljust(8) + "".join(fields[i : i + 4]) for i in range(0, len(fields), 4)]
    return "\n".join(lines) + "\n"


def _write_blocks(levels: Sequence[LoadLevel], comment: str, block: Callable[[list[float]], list[str]]) -> str:
    """A block of ratios a table; all but the first stand as comments."""
    lines: list[str] = []
    for number, level, which, ratios in _each_table(levels):
        off = "" if number == 1 else f"{comment} "
        lines += [*_describe(level, which, comment), *(off + line for line in block(ratios))]
    return "\n".join(lines) + "\n"


def _block_abaqus(ratios: list[float]) -> list[str]:
    """``*MODAL DAMPING, MODAL=DIRECT`` with a line a mode."""
    lines = (f"{mode}, {mode}, {ratio:.9g}" for mode, ratio in enumerate(ratios, start=1))
    return ["*MODAL DAMPING, MODAL=DIRECT", *lines]


def _block_ansys(ratios: list[float]) -> list[str]:
    """``MDAMP`` commands, six modes a line."""
    starts = range(0, len(ratios), RATIOS_A_LINE)
    return [f"MDAMP,{i + 1}," + ",".join(f"{r:.9g}" for r in ratios[i : i + RATIOS_A_LINE]) for i in starts]


def _block_opensees(ratios: list[float]) -> list[str]:
    """``modalDamping`` of as many modes."""
    return [f"eigen {len(ratios)}", "modalDamping " + " ".join(f"{ratio:.9g}" for ratio in ratios)]


def _write_openfast(levels: Sequence[LoadLevel], comment: str) -> str:
    """Linear and quadratic coefficients of the generalized force, by mode, median and low, in the form's units."""
    modes = list(dict.fromkeys(point.mode for level in levels for point in level.points))
    lines: list[str] = []
    for mode in modes:
        points = [point for level in levels for point in level.points if point.mode == mode]
        for which in ("median", "low"):
            linear, quadratic = fit_coefficients(points, which)
            lines += [f"{comment} {mode}, {which}, over {len(points)} load level(s)"]
            lines += [f"{linear:.9g}  AddBLin", f"{quadratic:.9g}  AddBQuad"]
    return "\n".join(lines) + "\n"


def fit_coefficients(points: Sequence[Point], which: str) -> tuple[float, float]:
    """c1 and c2 >= 0 of c1 q' + c2 q' |q'| that carry the forces of the points at their amplitudes (see the module).

    The low bound of damping is the force that the low ratio means: F low/median. AnalysisError: the form holds no
    forces and amplitudes.
    """
    from scipy.optimize import nnls  # noqa: PLC0415 - slow to import, and one deck needs it

    omega = 2.0 * pi * np.array([point.frequency for point in points])
    A = np.array([point.amplitude for point in points])
    F = np.array([point.force * getattr(point, which) / point.median for point in points])
    if not np.all(np.isfinite(A) & np.isfinite(F)):
        raise AnalysisError("coefficients need force and amplitude of each level: a form loads/1 or curve/1")
    columns = np.stack([omega * A, 8.0 / (3.0 * pi) * (omega * A) ** 2], axis=1) / F[:, None]
    scale = columns.max(axis=0)
    linear, quadratic = nnls(columns / scale, np.ones(len(F)))[0] / scale
    return float(linear), float(quadratic)


#: Structural codes, each with what writes its deck and how its comments begin.
CODES: dict[str, tuple[Callable[[Sequence[LoadLevel], str], str], str]] = {
    "nastran": (_write_nastran, "$"),
    "abaqus": (partial(_write_blocks, block=_block_abaqus), "**"),
    "ansys": (partial(_write_blocks, block=_block_ansys), "!"),
    "opensees": (partial(_write_blocks, block=_block_opensees), "#"),
    "openfast": (_write_openfast, "!"),
}
