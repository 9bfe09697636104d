"""Ranking, loads and curve of a record, on the terminal and as JSON forms (``rank/1``, ``loads/1``, ``curve/1``)."""

import math
import shlex
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import damping
from damping.answers import CurveResult, LoadsResult, PredictedResult, RankingResult
from damping.errors import InputError
from damping.extrapolation.cautions import BEYOND_TEST
from damping.extrapolation.draws import LEAST_WEIGHT, Member
from damping.extrapolation.prediction import Band
from damping.extrapolation.requested import list_asked
from damping.ranking import Candidate
from damping.records.mode import Mode, Units, read_mode
from damping.records.reading import read_record
from damping.records.record import Record
from damping.report import choose_length, format_parameter_unit
from damping.report.forms import PART_NAMES
from damping.result import Result
from damping_pipelines.store import check_outputs, write_answer
from damping_pipelines.terminal import (
    Notes,
    PlainTable,
    console,
    name_quantity,
    number,
    number_with_error,
    progress,
    report_findings,
    suggest,
)

MOST_LAWS = 3  #: laws whose coefficients are shown
MOST_NAMED = 5  #: laws named with their weights
LEAST_NAMED = 0.0005  #: weight of a law named with it: a smaller one is 0.000 in its three decimals
#: Per cent; errors below it are rounding: a law with as many parameters as points passes through all.
SMALL = 0.01


@dataclass(frozen=True)
class Asked:
    """The arguments of every command on a record and its mode."""

    record: Path
    mode: Path
    json_out: str | None
    plot: Path | None
    seed: int
    max_size: int
    despite: Sequence[str]

    @property
    def settings(self) -> dict[str, Any]:
        """Common arguments of the functions of the library on a record."""
        return {"seed": self.seed, "despite": self.despite, "progress": progress}

    def read(self) -> tuple[Record, Mode]:
        """Read, check and audit both files before any work; findings go to standard error."""
        check_outputs({"--json": self.json_out, "--plot": self.plot}, self.record, self.mode)
        read = read_record(self.record, max_size=self.max_size)
        described = read_mode(self.mode, max_size=self.max_size)
        report_findings(read, described, self.despite)
        return read, described

    def write(self, result: Result) -> bool:
        """Write form and figure, and return whether to print the table."""
        write_answer(self.json_out, result, self.plot)
        return self.json_out != "-"

    def name(self, command: str, force: Sequence[float] = (), amplitude: Sequence[float] = ()) -> str:
        """Another command on the same files, as typed in a shell."""
        given = (("--force", value) for value in force), (("--amplitude", value) for value in amplitude)
        options = [word for option, value in chain(*given) for word in (option, f"{value:.12g}")]
        return shlex.join(["damping", command, str(self.record), "--mode", str(self.mode), *options])

    def suggest_export(self, command: str, form: str, *given: Sequence[float]) -> list[str]:
        """The commands from this answer to a deck: the form first, unless it has just been written."""
        first = [] if self.json_out else [f"{self.name(command, *given)} --json {form}"]
        deck = shlex.join(["damping", "export", self.json_out or form, "--to", "nastran", "--out", "damping.bdf"])
        return [*first, f"{deck}   (a table per load level)"]


def rank(**files: Any) -> None:
    """Rank the candidates of a record, print the table and write the form; ``files`` are the fields of ``Asked``."""
    asked = Asked(**files)
    read, described = asked.read()
    ranking = damping.rank(read, described, **asked.settings)
    if asked.write(ranking):
        print_ranking(ranking, ranking.mode or described)
        suggest(f"{asked.name('curve')}   (damping ratio and Q)")


def print_ranking(result: RankingResult, mode: Mode) -> None:
    """Print the tables of the laws and of the coefficients of the best."""
    out, notes = console(), Notes()
    numbers = ("weight", "fitted error %", "held-out error %", "score", "equal laws", "notes")
    table = PlainTable(f"{mode.name}: damping laws, best first", numbers, ("", "law"))
    errors = result.table[["average_absolute_percent", "held_out_error", "score"]].to_numpy(float)
    shown = [(c, row) for c, row in zip(result.ranking.candidates, errors, strict=True) if c.weight > LEAST_WEIGHT]
    _print_headlines(result.headlines)
    for c, row in shown:
        rank_text = "-" if c.rank is None else str(c.rank)
        fitted, held_out = ("< 0.01" if value < SMALL else number(value, 3) for value in row[:2])
        weighed = (f"{c.weight:.3f}", fitted, held_out, f"{row[2]:.2f}", str(len(c.equivalents) or ""))
        table.add_row(rank_text, c.name, *weighed, notes.numbers(c.cautions))
    out.print(table)
    out.print(_tabulate_coefficients([c for c, _ in shown[:MOST_LAWS]], mode.units))
    rest = len(result) - len(shown)
    of_rows = "; the first line counts every row, beside resonance too" if result.headlines else ""
    out.print(f"Criterion: {result.ranking.criterion}. Errors are in % of resonant amplitude{of_rows}.")
    out.print(f"{rest} further laws weigh less than {100 * LEAST_WEIGHT:g} %: --json lists them.")
    _print_notes(notes, result)


def _print_headlines(sentences: Iterable[str]) -> None:
    for sentence in sentences:
        console().print(f"{sentence[0].upper()}{sentence[1:]}.", style="bold red")


def _print_notes(notes: Notes, result: RankingResult | PredictedResult) -> None:
    """Print the notes, and the cautions that were not printed before the result."""
    notes.show(console(), (caution for caution in result.cautions if caution not in result.headlines))


def _tabulate_coefficients(laws: Sequence[Candidate], units: Units) -> object:
    """Coefficients of numbered laws with their units: medians and 90 % intervals."""
    numbers, names = ("median", "low", "high", "T-ratio"), ("law", "coefficient", "unit")
    table = PlainTable("Coefficients of laws by number, median and 90 % interval", numbers, names)
    for c in laws:
        for x in c.coefficients:
            values = (number(value) for value in (x.value, x.low, x.high))
            unit = format_parameter_unit(x.parameter, units)
            table.add_row(str(c.rank), x.parameter, unit, *values, number(x.t_ratio, 3))
    return table


def extrapolate(force: Sequence[float], amplitude: Sequence[float], level: float, **files: Any) -> None:
    """Predict resonances at design forces or amplitudes, print the table and write the form."""
    if bool(force) == bool(amplitude):
        given = "both --force and --amplitude" if force else "neither --force nor --amplitude"
        raise InputError(given, expected="one of them, once or more")
    list_asked(force or amplitude, "force" if force else "amplitude", level)
    asked = Asked(**files)
    read, described = asked.read()
    loads = damping.extrapolate(read, described, force, level, amplitudes=amplitude, **asked.settings)
    if asked.write(loads):
        print_loads(loads)
        suggest(*asked.suggest_export("extrapolate", "loads.json", force, amplitude))


def print_loads(result: LoadsResult) -> None:
    """Print the tables of the predictions, with the parts of the spread and the basis of the weights."""
    out, notes, mode = console(), Notes(), result.mode
    loads, plan, units = result.loads, result.extrapolation.plan, mode.units
    _print_headlines(result.headlines)
    by_force, largest = loads.amplitude is None, loads.average.high if loads.amplitude is None else loads.amplitude
    asked, answer = ("force", "amplitude") if by_force else ("amplitude", "force")
    factor, length = choose_length(units.length, next(filter(math.isfinite, largest), math.nan))
    factors = {"force": 1.0, "amplitude": factor}
    named = {"force": name_quantity(units.drive, units.force), "amplitude": name_quantity("amplitude", length)}
    of_answer = name_quantity("amplitude at resonance", length) if by_force else f"{named['force']} at resonance"
    first = named[asked]
    band = ("times tested force", "median", "low", "high", "linear", "linear over by %", "notes")
    table = PlainTable(f"{mode.name}: {of_answer}", (first, *band))
    damped = ("frequency Hz", "damping ratio %", "low %", "high %", "Q")
    ratios = PlainTable("Damping there; size a load with its low end", (first, *damped))
    parts = PlainTable(f"Parts of the band: standard deviations, % of {answer}", (first, *PART_NAMES.values()))
    for row, cautions in zip(result.table.to_dict("records"), loads.cautions, strict=True):
        at = f"{factors[asked] * row[asked]:g}"
        ends = (factors[answer] * row[name] for name in ("median", "low", "high", "linear"))
        over = number(row["linear_overprediction_percent"], 3)
        table.add_row(at, number(row["extrapolation_ratio"], 3), *map(number, ends), over, notes.numbers(cautions))
        zeta = [row[f"damping_ratio{end}"] for end in ("", "_low", "_high")]
        ratios.add_row(at, _state_frequency(row), *(number(100.0 * z, 3) for z in zeta), number(0.5 / zeta[0], 3))
        parts.add_row(at, *(number(row[f"sd_percent_{name}"], 2) for name in PART_NAMES))
    for each in (table, ratios, parts):
        out.print(each)
    out.print(PARTS_EXPLAINED)
    out.print(f"low to high: {100 * loads.level:g} % predictive band, averaged over laws by weight. {FARTHER}")
    out.print(_name_laws(loads.by_model))
    if len(plan.trend.p):
        exponents = ", ".join(f"{p:.2f} ± {sd:.2f}" for p, sd in zip(plan.trend.p, plan.trend.sd, strict=True))
        out.print(f"Local exponent p = d ln F/d ln A, from level to level: {exponents}.")
    if by_force:
        _print_what_if(result, factor, length)
    _print_notes(notes, result)


#: What the parts of a band are, for a reader of the terminal alone.
PARTS_EXPLAINED = (
    "The squares of the parts add. noise = scatter of one reading; coefficients = those of each law, known from the "
    "tested levels alone; which law = the laws predict differently; change of the law beyond the test = a law that "
    "holds in the test need not hold beyond it."
)
#: What the varied priors are called.
PRIOR_NAMES = {"scatter": "scatter of readings", "share": "evenness of terms", "discrepancy": "change of the law"}
#: Note on the frequency: the terminal has room for one side of a band that is wider where the resonance moves.
FARTHER = "±: to the farther end of the frequency band."


def _state_frequency(row: Mapping[Hashable, Any]) -> str:
    """A frequency with the width of its band, if any."""
    f, low, high = (float(row[f"frequency{end}"]) for end in ("", "_low", "_high"))
    farther = max(f - low, high - f)
    return number_with_error(f, farther)


def _name_laws(laws: Iterable[Band | Member]) -> str:
    """The laws of largest weight in one line."""
    ordered = sorted(laws, key=lambda law: -law.weight)
    named = [law for law in ordered[:MOST_NAMED] if law.weight >= LEAST_NAMED]
    more = f", and {len(ordered) - len(named)} more" if len(named) < len(ordered) else ""
    weighed = ", ".join(f"{law.name} {law.weight:.3f}" for law in named)
    return f"Laws by weight on rows near resonance: {weighed}{more}."


def _print_what_if(result: LoadsResult, factor: float, length: str) -> None:
    """Print bands with other priors, times ``factor`` in the unit ``length``, and what to test next."""
    out, further, units = console(), result.extrapolation.next_level, result.mode.units
    varied = result.extrapolation.with_other_priors.dropna(subset="median")
    headings = (name_quantity(units.drive, units.force), "prior times", "median", "low", "high")
    table = PlainTable(name_quantity("The band with other priors", length), headings, ("prior",))
    for row in varied.sort_values("force", kind="stable").to_dict("records"):
        ends = (number(factor * row[name]) for name in ("median", "low", "high"))
        table.add_row(PRIOR_NAMES[str(row["prior"])], f"{row['force']:g}", f"{row['factor']:.2g}", *ends)
    if len(varied):
        out.print(table)
    if further is not None:
        out.print(
            f"To test next: one more level at {further.force:.3g} {units.force}".rstrip()
            + f". It would shrink the band at {further.design:g} {units.force}".rstrip()
            + f" from a factor of {further.width:.2f} between its ends to {further.expected:.2f}."
        )


def curve(amplitude: Sequence[float], force: Sequence[float], level: float, **files: Any) -> None:
    """Damping ratio, Q and frequency against amplitude; print the table and write the form."""
    for values, what in ((amplitude, "amplitude"), (force, "force")):
        list_asked(values, what, level)
    asked = Asked(**files)
    read, described = asked.read()
    traced = damping.curve(read, described, amplitude, force, level, **asked.settings)
    if asked.write(traced):
        print_curve(traced)
        suggest(*asked.suggest_export("curve", "curve.json", force, amplitude))


def print_curve(result: CurveResult) -> None:
    """Print the table of the curve."""
    out, notes, units = console(), Notes(), result.mode.units
    _print_headlines(result.headlines)
    factor, length = choose_length(units.length, result.table["amplitude"].max())
    numbers = (
        *(name_quantity("amplitude", length), name_quantity(units.drive, units.force), "frequency Hz"),
        *("damping ratio %", "low %", "high %", "Q", "tested", "notes"),
    )
    table = PlainTable(f"{result.mode.name}: damping of the resonance", numbers)
    smallest = result.prepared.data.tested_amplitude.min()
    for row, cautions in zip(result.table.to_dict("records"), result.curve.cautions, strict=True):
        zeta = (100.0 * row[f"damping_ratio{end}"] for end in ("", "_low", "_high"))
        further = [caution for caution in cautions if not caution.startswith(BEYOND_TEST)]
        table.add_row(
            *(number(value) for value in (factor * row["amplitude"], row["force"])),
            _state_frequency(row),
            *(number(z, 3) for z in zeta),
            number(row["q"], 3),
            "yes" if row["tested"] else "below" if row["amplitude"] < smallest else "beyond",
            notes.numbers(further),
        )
    out.print(table)
    out.print(
        f"low to high: {100 * result.curve.level:g} % predictive band, averaged over laws by weight. "
        f"{FARTHER} The low end of the damping is the one a load is sized with. Loss factor = 1/Q."
    )
    out.print(_name_laws(result.extrapolation.members))
    _print_notes(notes, result)
