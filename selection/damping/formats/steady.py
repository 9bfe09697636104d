"""Sweeps to a record: displacement amplitude, its lag behind the force, and the force, in one system of units."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from damping.arrays import RAD_S_PER_HZ, BoolArray, FloatArray, wrap_lag
from damping.errors import InputError, naming
from damping.formats.conversion import (
    SCALINGS,
    Conversion,
    Statements,
    ask,
    conversion,
    deviation_factor,
    other_factor,
    scaling,
)
from damping.formats.excitation import note_excitation
from damping.formats.levels import find_level, find_level_scaling
from damping.formats.quantity import SYSTEMS, find_powers, unit
from damping.formats.series import Samples, Series, Stated, Summary
from damping.records.record import Record, find_problems
from damping.records.text import count, name_apart

#: Most rows of an imported record; for more, a band of frequencies or some data sets must be chosen.
MOST_ROWS = 100_000
FEWEST_LEVELS = 3  #: levels from which digits show which column was held: of two, both may be round by chance
ROUND_DIGITS = 2  #: most significant digits of a level that somebody chose
FOLLOWS = "follows: a passive structure absorbs energy"  #: source of the sense of a phase
#: Least `measure_turn` by which a phase is a lead or a lag. Of 1800 whole sweeps, linear or not, with noise to 10 %,
#: none was read in the wrong sense, of 1800 of one flank of a resonance 22 (by the slope of the lag, 21 and 26).
LEAST_TURN = 0.03
_LABEL_AGREES = 0.05  # relative difference of a stated force and the level in a label, up to which they are the same
_POWERS = {"energy": (1, 1, 0), "mass": (1, -1, 2)}


def steady_record(series: Sequence[Series], stated: Stated, file: str | Path, summary: Summary) -> Record:
    """The record of some sweeps; facts are added to ``summary``.

    A response of order n (0 displacement, 1 velocity, 2 acceleration) is R exp(i omega t) with complex R; the
    displacement is X = R/(i omega)^n, times the force if R is a ratio. Amplitude |X|, phase arg F - arg X, within
    -pi/2..3 pi/2. Rows that are not steady states (0 Hz, no force, no response, no number) are left out and counted.

    InputError: a fact that neither the file nor the user states; no rows; rows that are invalid in a record.
    """
    with naming(file):
        table = _tabulate(series, stated, summary)
        if any(Statements(row.facts, stated, summary).is_ratio for row in series):
            texts = (text for row in series for text in (row.label, *row.facts.remarks))
            note_excitation((Path(file).stem, *texts), summary)
    return Record(table, str(file))


def _tabulate(series: Sequence[Series], stated: Stated, summary: Summary) -> pd.DataFrame:
    low, high = stated.band or (0.0, np.inf)
    many = sum(int(np.count_nonzero((row.abscissa >= low) & (row.abscissa <= high))) for row in series)
    if many > MOST_ROWS:
        expected = f"at most {MOST_ROWS}: choose --band LO:HI about the mode, or --dataset"
        raise InputError(f"{many} rows", expected=expected)
    labels, forces = _list_labels(series, stated), _stated_forces(series, stated)
    with np.errstate(all="ignore"):  # the range check below finds overflows
        tables = [
            _tabulate_sweep(row, label, force, Statements(row.facts, stated, summary))
            for row, label, force in zip(series, labels, forces, strict=True)
        ]
    if len({"phase" in table for table in tables}) > 1:
        raise InputError("some sweeps have phases and some have none", expected="sweeps of one kind")
    table = pd.concat(tables, ignore_index=True)
    for problem in find_problems(table):
        where = f"{problem.message} in row {problem.row + 1} of the record"
        if problem.column is None:
            label, frequency = table["sweep"].iloc[problem.row], table["frequency"].iloc[problem.row]
            where = f"sweep {label!r} has a row twice, at {frequency:g} Hz"
        raise InputError(where, column=problem.column, expected=problem.expected)
    if not stated.consistent:
        force, length = SYSTEMS[stated.system]
        system = f"force in {force}, amplitude in {length}, time in s, mass in {force} s^2/{length}"
        summary.add("record", system, "stated")
    summary.add("rows", f"{len(table)} in {count(len(tables), 'sweep')}", "follows")
    if len(table) == len(series) >= FEWEST_LEVELS and not forces[0] and _are_exchanged(series):
        what = "caution: the responses are round numbers and the forces are not"
        summary.note(f"{what}: right if the response was held; if the force was, their two headings are exchanged")
    if "phase" not in table:
        summary.note("no phases: each sweep gives the damping only at its resonance")
        return table
    wrong = int(np.count_nonzero(np.sin(table["phase"]) < 0.0))
    if wrong > len(table) / 2:
        raise InputError(
            f"at {wrong} of {len(table)} rows the response returns energy (phase outside 0..pi): is the sensor "
            "mounted against the force, or the phase of the other sign?",
            expected="--reverse, or the phase as lead instead of lag (or vice versa)",
        )
    return table


def _are_exchanged(series: Sequence[Series]) -> bool:
    """Whether responses, of one row each, are round as the held quantity is, and forces are not, as a measured one."""
    held = [_count_digits(row.response) for row in series]
    measured = [_count_digits(row.force) for row in series if row.force is not None]
    return max(held) <= ROUND_DIGITS < float(np.median(measured))


def _count_digits(values: Samples) -> int:
    """Significant digits of the first of some values (n,), to seven."""
    return len(f"{abs(values[0]):.6e}".split("e")[0].replace(".", "").rstrip("0"))


def _list_labels(series: Sequence[Series], stated: Stated) -> list[str]:
    """Unique label of each sweep."""
    if stated.labels:
        if len(stated.labels) != len(series) or len(set(stated.labels)) < len(series):
            expected = f"{len(series)} different ones, one for each sweep"
            raise InputError(f"{len(stated.labels)} labels", expected=expected)
        return list(stated.labels)
    return name_apart(" ".join(row.label.split()) or "sweep" for row in series)


def _stated_forces(series: Sequence[Series], stated: Stated) -> list[float | None]:
    """Stated force amplitude of each sweep; None if it is in the file."""
    if not stated.forces:
        return [None] * len(series)
    if len(stated.forces) not in (1, len(series)):
        several = f"1 or {len(series)}, one for each sweep" if len(series) > 1 else "1, as there is one sweep"
        raise InputError(f"{len(stated.forces)} forces", expected=several)
    if any(not (np.isfinite(force) and force > 0.0) for force in stated.forces):
        raise InputError("--force is no force amplitude", expected="numbers > 0")
    many: list[float | None] = list(stated.forces)
    return many if len(many) == len(series) else many * len(series)


def _tabulate_sweep(row: Series, label: str, level: float | None, known: Statements) -> pd.DataFrame:
    ask(known, force=level is not None or row.force is not None)
    to = conversion(known)
    frequency = np.asarray(row.abscissa, dtype=np.float64)
    keep = _usable(row, label, known)
    omega = RAD_S_PER_HZ * frequency[keep]
    F = _force(row, keep, level, to, known)
    X = row.response[keep] * (to.response * (-1.0 if known.stated.reverse else 1.0)) / (1j * omega) ** to.order
    if row.facts.turn:
        X = _turned(row.response[keep], X, frequency[keep], label, known)
    X = X * (np.abs(F) if to.per_force else scaling(known))
    columns = {"sweep": [label] * len(omega), "force": np.abs(F), "frequency": frequency[keep], "amplitude": np.abs(X)}
    if row.has_phase:
        drive = np.ones_like(F) if to.per_force else F
        columns["phase"] = wrap_lag(np.angle(drive) - np.angle(X))
    table = pd.DataFrame(columns)
    for name, values in row.extra.items():
        table[name] = values[keep]
        if name in _POWERS:
            table[name] *= other_factor(name, _POWERS[name], known)
        elif name in ("amplitude_sd", "force_sd"):  # scaled as its quantity
            quantity, raw = ("response", row.response) if name == "amplitude_sd" else ("force", row.force)
            if raw is None:
                raise InputError("force_sd without a force", expected="a column of the force")
            table[name] *= deviation_factor(name, quantity, known)
            table[name] = table[name] / np.abs(raw[keep]) * table[name.removesuffix("_sd")]
    return table


def _usable(row: Series, label: str, known: Statements) -> BoolArray:
    """Rows that are steady states within the band."""
    f, band, reasons = row.abscissa, known.stated.band, _left_out(row)
    keep: BoolArray = ~np.any(list(reasons.values()), axis=0)
    lost = int(np.count_nonzero(~keep))
    sizes = {reason: int(np.count_nonzero(rows)) for reason, rows in reasons.items()}
    counts = ", ".join(f"{count} {reason}" for reason, count in sizes.items() if count)
    if lost:
        known.summary.note(f"{count(lost, 'row')} of {label!r} left out: {counts}")
    if band is not None:
        known.summary.add("band", f"{band[0]:g} to {band[1]:g} Hz", "stated")
        keep &= (f >= band[0]) & (f <= band[1])
    if not keep.any():
        within = "" if band is None else f" within {band[0]:g} to {band[1]:g} Hz"
        why = f": of {len(f)}, {counts}" if lost else ""
        raise InputError(f"no row of {label!r} is a steady state{within}{why}", expected="at least one")
    return keep


def _left_out(row: Series) -> dict[str, BoolArray]:
    """Rows that are not steady states, by the first reason that applies."""
    columns = {"response": row.response, **({} if row.force is None else {"force": row.force}), **row.extra}
    columns.pop("sweep_rate", None)  # it may be unknown
    f = row.abscissa
    reasons: dict[str, BoolArray] = {"at 0 Hz": f == 0.0, "without a frequency > 0": ~(np.isfinite(f) & (f > 0.0))}
    for name, values in columns.items():
        reasons[f"with no finite {name}"] = ~np.isfinite(values)
    for name in ("response", "force"):
        if name in columns:
            reasons[f"with a {name} of 0"] = columns[name] == 0.0
    counted = np.zeros(len(row.abscissa), dtype=np.bool_)
    for reason, rows in reasons.items():
        reasons[reason] = rows & ~counted
        counted |= rows
    return reasons


def _force(row: Series, keep: BoolArray, level: float | None, to: Conversion, known: Statements) -> FloatArray:
    """Force amplitude of each row (complex if the file has its phase)."""
    if level is None and row.force is None:
        message = "no force in the file: the damping depends on how hard the structure was driven"
        raise InputError(message, expected="--force AMPLITUDE of each sweep, or --column force=NAME")
    if to.force is None:
        raise InputError("the unit of the force is neither in the file nor stated", expected="--unit force=N")
    if level is not None:
        scaled = known.stated.force_scaling
        said = " ".join(filter(None, (f"{level:g}", known.unit_of("force"), scaled)))
        known.summary.add("force", f"{said} at every row", "stated")
        _compare_with_label(row.label, level, known)
        return np.full(int(np.count_nonzero(keep)), level * to.force * SCALINGS[scaled or "peak"])
    known.summary.add("force", "measured at every row", "found in the file")
    assert row.force is not None  # checked above
    return np.asarray(row.force[keep] * to.force * scaling(known, of_force=True))


def _compare_with_label(label: str, stated: float, known: Statements) -> None:
    """Note a caution if a label names another level than the force that is stated."""
    words = label.replace("_", " ")
    named, text = find_level(words), known.unit_of("force")
    if named is None or not named[0] > 0.0 or known.stated.consistent or find_powers(text) != find_powers(named[1]):
        return
    peak = stated * unit(text).factor * SCALINGS[known.stated.force_scaling or "peak"]
    of_label = named[0] * unit(named[1]).factor * SCALINGS[find_level_scaling(words) or "peak"]
    if abs(peak / of_label - 1.0) > _LABEL_AGREES:
        remedy = "correct --force (one for each sweep, in their order), with --scaling force=rms if they are rms"
        known.summary.note(f"caution: {label!r} names another level than --force {stated:g} {text}: {remedy}")


def _turned(response: FloatArray, X: FloatArray, frequency: FloatArray, label: str, known: Statements) -> FloatArray:
    """The displacement, with its phase read as a lead or as a lag, whichever makes the structure absorb energy.

    The lag of the displacement of a passive structure lies between 0 and pi and rises through pi/2 with frequency.
    """
    other = np.conj(response) * (X / response)  # X of the conjugate response
    passive = [taken for taken in (X, other) if _is_passive(taken, frequency)]
    if len(passive) != 1:
        message = f"whether the phase of {label!r} leads or lags cannot be determined from its direction"
        turned = any(_is_passive(-taken, frequency) for taken in (X, other))
        remedy = "--reverse (a sensor mounted against the force), or " if turned and not passive else ""
        raise InputError(message, expected=f"{remedy}--column lead_deg=NAME or lag_deg=NAME (lead or phase in rad)")
    sense = "a lead of the response" if passive[0] is X else "a lag of the response"
    known.summary.add("phase", sense, FOLLOWS)
    if len([row for row in known.summary.rows if (row[0], row[2]) == ("phase", FOLLOWS)]) > 1:
        message = f"by its direction the phase of {label!r} is {sense}, unlike that of sweeps before it"
        raise InputError(message, expected="one sense: --column lead_deg=NAME or lag_deg=NAME (lead or phase in rad)")
    return passive[0]


def _is_passive(X: Samples, frequency: FloatArray) -> bool:
    """Whether the displacement lags by 0..pi for most of the motion, and turns as past a resonance."""
    X = X[np.argsort(frequency, kind="stable")]
    size = np.abs(X) ** 2
    lags = np.sum(size[X.imag < 0.0]) > 0.5 * np.sum(size)
    return bool(lags and (len(X) == 1 or measure_turn(X) < -LEAST_TURN))


def measure_turn(H: Samples) -> float:
    """Twice the area that a response (n,), by rising frequency, passes round 0, over its largest |H|^2.

    Past a resonance of either sign it is -pi/2 if phases are leads, pi/2 if lags; noise of neighbouring rows cancels.
    """
    of_largest = H / np.max(np.abs(H))
    return float(np.sum(np.imag(np.conj(of_largest[:-1]) * of_largest[1:])))
