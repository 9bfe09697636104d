"""Records whose truth is known, right and wrong: steady states of laws and springs, noise, and mishaps of a lab.

Nothing here knows the audit: steady states come from ``damping.predict``, linear modes from their modal sum, fast
sweeps from the equation of motion integrated in time.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from math import pi

import numpy as np
import pandas as pd
from scipy.integrate import solve_ivp

from damping.forces import CubicStiffness, Sum, from_damping
from damping.predict.branches import branches, followed
from damping.records.mode import Mode
from damping.records.record import Record

LAWS = (
    "viscous", "displacement", "velocity-squared", "displacement-velocity", "quadratic-displacement", "coulomb", "slip",
    "velocity-power",
)  # fmt: skip


@dataclass(frozen=True)
class Bench:
    """A structure and how it is tested; ``span`` in half-bandwidths, ``bend`` of the resonance in half-bandwidths."""

    law: str = "viscous"
    M: float = 10.0
    f: float = 10.0
    zeta: float = 0.01
    A: float = 0.01
    levels: int = 3
    rows: int = 41
    span: tuple[float, float] = (-6.0, 6.0)
    bend: float = 0.0
    noise: float = 0.01
    phase: bool = True
    offset: float = 0.0
    down: bool = False
    seed: int = 0

    @property
    def mode(self) -> Mode:
        """The mode file: true mass and frequency, viscous damping of the true size."""
        c = 2.0 * self.zeta * self.M * 2.0 * pi * self.f
        return Mode(
            name="case", frequency=self.f, mass=self.M, damping={"viscous": {"coefficient": c}}, source="case.toml"
        )


def force_of(bench: Bench) -> Sum:
    """Half viscous damping and half that of the law, in energy at the largest amplitude; a cubic spring."""
    w, A = 2.0 * pi * bench.f, bench.A
    K = bench.M * w**2
    wanted = 2.0 * bench.zeta * K * A
    c = 2.0 * bench.zeta * bench.M * w
    springs = [CubicStiffness(4.0 / 3.0 * 2.0 * bench.bend * bench.zeta * K / A**2)] if bench.bend else []
    if bench.law == "viscous":
        return Sum((*from_damping({"viscous": {"coefficient": c}}).forces, *springs))
    shape = {"coefficient": 1.0}
    if bench.law == "slip":
        shape = {"stiffness": 1.0, "limit": 0.25 * A}
    if bench.law == "velocity-power":
        shape = {"coefficient": 1.0, "exponent": 1.6}
    unit = float(from_damping({bench.law: shape}).quadrature(A, w))
    size = "stiffness" if bench.law == "slip" else "coefficient"
    damping = {"viscous": {"coefficient": 0.5 * c}, bench.law: {**shape, size: 0.5 * wanted / unit}}
    return Sum((*from_damping(damping).forces, *springs))


@cache
def clean(bench: Bench) -> pd.DataFrame:
    """Steady states without noise, as a slow sweep passes them in at least 200 steps."""
    force, w = force_of(bench), 2.0 * pi * bench.f
    between = -(-200 // (bench.rows - 1))
    fine = w * (1.0 + bench.zeta * np.linspace(*bench.span, (bench.rows - 1) * between + 1))
    omega = fine[::between]
    tables = []
    for level in range(bench.levels):
        A = bench.A * (level + 1.0) / bench.levels
        F = float(force.quadrature(A, w))
        found = followed(branches(force, F, fine, bench.M, w), between, "down" if bench.down else "up")
        kept = np.isfinite(found.amplitude)
        tables.append(
            pd.DataFrame(
                {
                    "sweep": chr(65 + level),
                    "force": F,
                    "frequency": omega[kept] / (2.0 * pi),
                    "amplitude": found.amplitude[kept],
                    "phase": found.phase[kept],
                }
            )
        )
    return pd.concat(tables, ignore_index=True)


def measured(table: pd.DataFrame, bench: Bench) -> pd.DataFrame:
    """Noise on amplitude and phase, a constant offset; six digits, as an instrument writes them."""
    rng = np.random.default_rng(bench.seed)
    out = table.copy()
    out["amplitude"] *= np.exp(bench.noise * rng.normal(size=len(out)))
    out["phase"] += bench.offset + bench.noise * rng.normal(size=len(out))
    for name in ("force", "frequency", "amplitude"):
        digits = 9 if name == "frequency" else 6
        out[name] = [float(f"{value:.{digits}g}") for value in out[name]]
    return out if bench.phase else out.drop(columns="phase")


def record_of(table: pd.DataFrame) -> Record:
    """The table as a record."""
    return Record(table.reset_index(drop=True), "case.csv")


def peaks(bench: Bench) -> pd.DataFrame:
    """One row a level, at phase resonance, without phase."""
    force, w = force_of(bench), 2.0 * pi * bench.f
    rng = np.random.default_rng(bench.seed)
    A = bench.A * (np.arange(bench.levels) + 1.0) / bench.levels
    F = np.array([float(force.quadrature(a, w)) for a in A])
    return pd.DataFrame(
        {
            "sweep": [chr(65 + k) for k in range(bench.levels)],
            "force": F,
            "frequency": bench.f * (1.0 + 0.1 * bench.zeta * rng.normal(size=len(A))),
            "amplitude": A * np.exp(bench.noise * rng.normal(size=len(A))),
        }
    )


def decay(bench: Bench, levels: int = 8) -> pd.DataFrame:
    """A free decay as one-row sweeps whose amplitude falls with time."""
    table = peaks(replace(bench, levels=levels)).iloc[::-1].reset_index(drop=True)
    table["sweep"] = [f"decay {k + 1:02d}" for k in range(levels)]
    table["time"] = np.arange(levels) / bench.f
    return table


def right_benches(count: int, seed: int) -> list[Bench]:
    """Benches over all laws, sizes, noise, levels, spans, bends and offsets that a good laboratory has."""
    rng = np.random.default_rng(seed)
    found = []
    for n in range(count):
        zeta = float(10.0 ** rng.uniform(-3.0, -1.5))
        sides = [
            (-6.0, 6.0),
            (-3.0, 3.0),
            (-12.0, 12.0),
            (-8.0, 2.0),
            (-2.0, 8.0),
            (-30.0, 30.0) if zeta < 0.005 else (-5.0, 5.0),
        ]
        found.append(
            Bench(
                law=LAWS[n % len(LAWS)],
                M=float(10.0 ** rng.uniform(-2.0, 4.0)),
                f=float(10.0 ** rng.uniform(-0.3, 2.5)),
                zeta=zeta,
                A=float(10.0 ** rng.uniform(-6.0, 0.0)),
                levels=int(rng.integers(1, 7)),
                rows=int(rng.choice([9, 13, 21, 41, 81, 161])),
                span=sides[rng.integers(len(sides))],
                bend=float(rng.choice([0.0, 0.0, 0.5, -0.5, 1.5, -1.5, 3.0, -3.0])),
                noise=float(10.0 ** rng.uniform(-2.5, -1.4)),
                phase=bool(rng.random() < 0.7),
                offset=float(rng.uniform(-0.03, 0.03)) if rng.random() < 0.3 else 0.0,
                down=bool(rng.random() < 0.3),
                seed=int(rng.integers(2**31)),
            )
        )
    # without a phase a sweep that ends before the bent resonance is no right record
    return [b for b in found if b.phase or b.span[0] + 1.0 < b.bend < b.span[1] - 1.0]


def dropped_out(table: pd.DataFrame, bench: Bench, share: float) -> pd.DataFrame:
    """A shaker that gives way: the measured force falls where the response is large (of a linear mode)."""
    out = table.copy()
    lost = 1.0 - share * (out["amplitude"] / out.groupby("sweep")["amplitude"].transform("max")) ** 2
    out["force"] *= lost
    out["amplitude"] *= lost
    return out


def at_one_amplitude(bench: Bench) -> pd.DataFrame:
    """Sweeps held at one response: the force dips at resonance."""
    force, w = force_of(bench), 2.0 * pi * bench.f
    omega = w * (1.0 + bench.zeta * np.linspace(*bench.span, bench.rows))
    tables = []
    for level in range(bench.levels):
        A = bench.A * (level + 1.0) / bench.levels
        Z = bench.M * (w**2 - omega**2) + (force.in_phase(A, omega) + 1j * force.quadrature(A, omega)) / A
        tables.append(
            pd.DataFrame(
                {"sweep": chr(65 + level), "force": np.abs(Z) * A, "frequency": omega / (2 * pi), "amplitude": A,
                 "phase": np.angle(Z)}
            )
        )  # fmt: skip
    return pd.concat(tables, ignore_index=True)


def many_modes(bench: Bench, ratios: tuple[float, ...] = (1.0, 1.6, 2.3, 3.1), rows: int = 400) -> pd.DataFrame:
    """A linear structure of several modes over the whole range."""
    hertz = np.linspace(0.7 * bench.f, 1.2 * max(ratios) * bench.f, rows)
    w = 2.0 * pi * hertz
    H = np.zeros(rows, complex)
    for k, ratio in enumerate(ratios):
        wn = 2.0 * pi * bench.f * ratio
        H += (1.0 if k % 2 == 0 else 0.7) / (bench.M * (wn**2 - w**2 + 2j * bench.zeta * wn * w))
    tables = [
        pd.DataFrame({"sweep": chr(65 + k), "force": 1.0 + k, "frequency": hertz, "amplitude": (1.0 + k) * np.abs(H),
                      "phase": np.mod(-np.angle(H), 2.0 * pi)})
        for k in range(bench.levels)
    ]  # fmt: skip
    return pd.concat(tables, ignore_index=True)


def swept_fast(bench: Bench, octaves_per_minute: float, rows: int = 150) -> pd.DataFrame:
    """A linear mode under a logarithmic sweep integrated in time: amplitude and lag of its slow envelope."""
    wn = 2.0 * pi * bench.f
    low = wn * (1.0 + bench.zeta * bench.span[0])
    high = wn * (1.0 + bench.zeta * bench.span[1])
    rate = np.log(2.0) * octaves_per_minute / 60.0
    start = low * 0.9
    T = np.log(high / start) / rate

    def slow(t: float, y: np.ndarray) -> list[float]:
        # q = Re(a e^{i theta}), theta' = w(t): M (a'' + 2 i w a' + i w' a - w^2 a) + c (a' + i w a) + K a = F
        w = start * np.exp(rate * t)
        a, v = complex(y[0], y[1]), complex(y[2], y[3])
        acc = (
            1.0 / bench.M
            - (2j * w + 2.0 * bench.zeta * wn) * v
            - (wn**2 - w**2 + 1j * (rate * w + 2 * bench.zeta * wn * w)) * a
        )
        return [v.real, v.imag, acc.real, acc.imag]

    hertz = np.linspace(low, high, rows) / (2.0 * pi)
    times = np.log(2.0 * pi * hertz / start) / rate
    found = solve_ivp(
        slow,
        (0.0, T),
        [1.0 / (bench.M * (wn**2 - start**2)), 0.0, 0.0, 0.0],
        t_eval=np.minimum(times, T),
        rtol=1e-6,
        atol=1e-12 / (bench.M * wn**2),
        method="DOP853",
    )
    a = found.y[0] + 1j * found.y[1]
    tables = [
        pd.DataFrame({"sweep": chr(65 + k), "force": 1.0 + k, "frequency": hertz, "amplitude": (1.0 + k) * np.abs(a),
                      "phase": -np.angle(a)})
        for k in range(bench.levels)
    ]  # fmt: skip
    return pd.concat(tables, ignore_index=True)


@cache
def wrong_cases(seed: int) -> dict[str, tuple[str, pd.DataFrame, Mode, bool]]:
    """Wrong records by name: the check that is to name each, the table, its mode, whether it is to be refused."""
    rng = np.random.default_rng(seed)
    b = replace(right_benches(8, seed)[seed % 8], levels=int(rng.integers(2, 5)), phase=True, bend=0.0, offset=0.0)
    b = replace(b, rows=int(rng.choice([21, 41, 81])), span=(-6.0, 6.0), zeta=float(10 ** rng.uniform(-2.7, -1.7)))
    table, mode = measured(clean(b), b), b.mode
    bare = table.drop(columns="phase")
    found: dict[str, tuple[str, pd.DataFrame, Mode, bool]] = {}

    def add(name: str, check: str, wrong: pd.DataFrame, refuse: bool = True, of: Mode = mode) -> None:
        found[name] = (check, wrong, of, refuse)

    add("m for mm", "units", table.assign(amplitude=table["amplitude"] / 1000.0))
    add("mm for m, no phase", "units", bare.assign(amplitude=bare["amplitude"] * 1000.0))
    add("g for m/s^2", "units", table.assign(amplitude=table["amplitude"] / 9.80665))
    add("g for m/s^2, no phase", "units", bare.assign(amplitude=bare["amplitude"] / 9.80665))
    add("lb for N", "units", table.assign(force=table["force"] / 4.448))
    add("rad/s for Hz", "units", table.assign(frequency=table["frequency"] * 2.0 * pi))
    add("peaks, m for mm", "units", peaks(b).assign(amplitude=lambda t: t["amplitude"] / 1000.0))
    add("exchanged", "units", table.rename(columns={"force": "amplitude", "amplitude": "force"}))
    add("exchanged, no phase", "units", bare.rename(columns={"force": "amplitude", "amplitude": "force"}))
    add("rms for peak", "beyond-model", table.assign(amplitude=table["amplitude"] / 2**0.5), False)
    add("other mode", "beyond-model", table, True, replace(mode, frequency=1.7 * mode.frequency))
    add("degrees, wrapped", "phase-unit", table.assign(phase=np.mod(np.degrees(table["phase"]), 2.0 * pi)))
    add("degrees", "phase-unit", table.assign(phase=np.degrees(table["phase"])))
    add("turns", "phase-unit", table.assign(phase=table["phase"] / (2.0 * pi)))
    add("turns of a lead", "phase-unit", table.assign(phase=-table["phase"] / (2.0 * pi)))
    add("negated", "phase-sign", table.assign(phase=-table["phase"]))
    add("minus pi", "phase-sign", table.assign(phase=table["phase"] - pi))
    add("lead of acceleration", "phase-sign", table.assign(phase=pi - table["phase"]))
    add("lead, wrapped", "phase-sign", table.assign(phase=np.mod(-table["phase"], 2.0 * pi)))
    add(
        "negated in one sweep",
        "phase-sign",
        table.assign(phase=np.where(table["sweep"] == "B", -table["phase"], table["phase"])),
    )
    add("offset .3", "phase-offset", table.assign(phase=table["phase"] + 0.3), False)
    add("offset -.15", "phase-offset", table.assign(phase=table["phase"] - 0.15), False)
    short = replace(b, span=(-12.0, -1.5))
    below = measured(clean(short), short)
    add("below", "edge-of-sweep", below, False)
    add("below, no phase", "edge-of-sweep", below.drop(columns="phase"))
    late = replace(b, span=(2.0, 12.0))
    add("above, no phase", "edge-of-sweep", measured(clean(late), late).drop(columns="phase"))
    modes = measured(many_modes(b), b)
    add("four modes", "several-modes", modes, False)
    add("four modes, no phase", "several-modes", modes.drop(columns="phase"), False)
    order = table["sweep"].map({label: k for k, label in enumerate(sorted(table["sweep"].unique()))})
    last = int(order.max())
    forces = table.groupby(order)["force"].first()
    add(
        "falling",
        "amplitude-falls",
        table.assign(force=forces[last - order].to_numpy()).pipe(lambda t: t.assign(amplitude=t["amplitude"])),
    )
    p = peaks(b)
    add("peaks falling", "amplitude-falls", p.assign(force=p["force"].to_numpy()[::-1]))
    energy = pi * table["force"] * table["amplitude"] * np.abs(np.sin(table["phase"]))
    add("energy", "energy", table.assign(energy=2.0 * energy + 1e-12))
    add("energy, no phase", "energy", bare.assign(energy=2.0 * energy + 1e-12))
    for name, source in (("ten times", table), ("ten times, no phase", bare)):
        wild = source.copy()
        wild.loc[int(rng.integers(len(wild))), "amplitude"] *= 10.0
        add(name, "outlier", wild, False)
    copy = table[table["sweep"] == "A"].assign(sweep="copy")
    add("copy", "repeated-sweep", pd.concat([table, copy]), False)
    add(
        "scaled copy",
        "repeated-sweep",
        pd.concat([table, copy.assign(force=2 * copy["force"], amplitude=2 * copy["amplitude"])]),
        False,
    )
    b4 = replace(b, levels=4)
    four = measured(clean(b4), b4)
    add("one label", "mixed-levels", four.assign(sweep="all"), False)
    add(
        "one label, sorted, no phase",
        "mixed-levels",
        four.assign(sweep="all").sort_values("frequency").drop(columns="phase"),
        False,
    )
    add("peaks alone, one label", "mixed-levels", peaks(b4).assign(sweep="all"), False)
    n = len(table)
    noise = table.assign(amplitude=b.A * np.exp(rng.normal(size=n)), phase=rng.uniform(0, pi, n))
    add("noise", "edge-of-sweep", noise)
    add("noise, no phase", "edge-of-sweep", noise.drop(columns="phase"))
    quick = replace(b, zeta=float(rng.choice([0.005, 0.007, 0.01, 0.015])), f=20.0, span=(-8.0, 12.0))
    fast = measured(swept_fast(quick, 4.0), quick)
    rate = np.log(2.0) * 4.0 / 60.0 * fast["frequency"]
    add("4 oct/min, rate", "sweep-rate", fast.assign(sweep_rate=rate), False, quick.mode)
    add("4 oct/min", "sweep-rate", fast, False, quick.mode)
    add("4 oct/min, no phase", "sweep-rate", fast.drop(columns="phase"), False, quick.mode)
    return found
