"""Rows near resonance, free of a constant phase offset, and the plan of a prediction made from them.

A plan says whether the law changes at the top of the test (local exponent p = d ln F/d ln A from level to level), which
laws are averaged with what weights, and how far beyond the test predictions are given.

Weights are posterior probabilities on the rows near resonance, by the same evidence that ranks. It allows exponents to
stray (:mod:`damping.infer.doubt`), so that levels do not carry more weight than their information.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri, stdtr

from damping.arrays import BoolArray, FloatArray, Floats, IntArray
from damping.extrapolation.states import describe_state, read_resonances
from damping.infer.doubt import ANY_JOINT, JOINTS, JointEvidence
from damping.infer.evidence import Estimate, evidence
from damping.infer.law import Law
from damping.infer.observations import Observations, at_resonance, observe
from damping.ranking import Candidate, weigh_laws
from damping.ranking.verdict import FitVerdict
from damping.records import Audit
from damping.records.mode import Mode, Units
from damping.records.record import Record
from damping.records.resonance import SAME_LEVEL, tabulate_resonances

#: Ratio of amplitudes from which the rows of one level show how damping changes with amplitude; a sweep at constant
#: response has less.
TELLING = 1.1
#: Rows with |cot phase| up to this are near resonance: those between the half-power points of their sweep.
NEAR = 1.0


def near_resonance(record: Record) -> Observations:
    """One row for each sweep, its phase resonance; every row near resonance if one level shows how damping changes.

    A constant phase offset changes the energy of a row by offset times cot(phase), relative: the offset found by
    :func:`damping.records.resonance.tabulate_resonances` is subtracted first, unless the record has an energy column.
    Then rows between the half-power points are kept, |F cos(phase)| <= ``NEAR`` F sin(phase): beyond them the measured
    energy is mostly phase error. A sweep without such rows keeps the row nearest to resonance.

    Raises:
        AnalysisError: no row carries information about damping.
    """
    data = observe(without_offset(record))
    cotangent = np.where(data.D > 0.0, data.R / np.where(data.D > 0.0, data.D, 1.0), np.inf)
    near = cotangent <= NEAR
    for run in data.runs:
        near[run[np.argmin(cotangent[run])]] = True
    data = data.take_rows(near)
    one_telling = data.levels.max() == 0 and data.A.max() > TELLING * data.A.min()
    return data if one_telling else at_resonance(data)


def describe_rests(data: Observations, rows: int) -> tuple[str, ...]:
    """Where weights rest on fewer than the ``rows`` that a ranking has, and what one level does not tell."""
    on = "resonances of the sweeps, because rows of one sweep share its error"
    on = on if len(data.A) == len(data.sweeps) else "rows between the half-power points"
    fewer = f"weights are those of the laws on the {on}; a ranking weighs them on every row"
    return tuple(filter(None, [fewer if len(data.A) < rows else "", _describe_one_level(data, rows)]))


def _describe_one_level(data: Observations, rows: int) -> str:
    """Caution for a record of one level; empty for several.

    For structures outside the library the 90 % band of one sweep misses a quarter.
    """
    if data.levels.max() > 0:
        return ""
    sweeps = len(data.sweeps)
    of = f" ({sweeps} sweeps within {100.0 * SAME_LEVEL:g} % of one another)" if sweeps > 1 else ""
    why = ", because frequency changes too along a sweep" if rows > sweeps else ""
    return (
        f"one level{of} does not show how damping changes with amplitude{why}: do not trust the band beyond the tested "
        "force, and test a second level"
    )


def without_offset(record: Record) -> Record:
    """The record with each sweep's phase offset subtracted; unchanged if it has no phases, or recorded energies."""
    if not record.has_phase or "energy" in record.frame.columns:
        return record
    offset = tabulate_resonances(record).set_index("sweep")["phase_offset"]
    table = record.frame.copy()
    table["phase"] = table["phase"] - table["sweep"].astype(str).map(offset)
    return Record.trusted(table, record.source)


def observe_ranked(record: Record, findings: Audit) -> tuple[Observations, tuple[str, ...]]:
    """Every row as laws are ranked on it, and notes: a phase offset that the audit finds is subtracted."""
    freed = without_offset(record) if any(f.check == "phase-offset" for f in findings.findings) else record
    if freed is record:
        return observe(record), ()
    offset = float(np.median(record.column("phase") - freed.column("phase")))
    said = f"each sweep's constant phase offset (median {offset:.3g} rad) was removed before laws were fitted"
    return observe(freed), (said,)


#: Standard normal quantile (one-sided 5 %) beyond which a change of p is reported.
CHANGES = 1.64
#: Scatter of resonances before any is seen, and the degrees of freedom it is worth: a median of 1.2 %, as of the prior
#: of laws. At three levels that scatter by 3 % a constant p then seems to fall in 5 % of tests.
EXPECTED = (0.0078, 1.0)
#: Largest scatter where none larger is stated, the upper end of the prior of laws: whatever the levels seem to scatter,
#: a change of many times this is one. Degrees of freedom of a scatter that is known.
MOST = 0.04
_CERTAIN = 1e9
#: Factor on the probability of a change in more than three sweeps: two for two shapes, two for tests that scatter more
#: than expected. At a scatter of 3 % a constant p then seems to fall in 4 to 5 % of tests, at 1 % in at most 2 %.
LOOKS = 4.0
#: Probability below which none is told apart.
_TINY = 1e-300


@dataclass(frozen=True)
class Trend:
    """Local exponents between neighbouring levels, lowest first.

    Attributes:
        force: geometric mean of the two forces, (levels - 1,). p, sd: exponent and its standard deviation by the
            scatter of resonances, (levels - 1,). z: change of p over the test or at its top level, as a standard normal
            deviate (:func:`find_change`); NaN with fewer than three levels.
    """

    force: FloatArray
    p: FloatArray
    sd: FloatArray
    z: float

    @property
    def rising(self) -> bool:
        """Whether p rises at the top of the test: damping grows faster than below."""
        return bool(self.z > CHANGES)

    @property
    def falling(self) -> bool:
        """Whether p falls at the top of the test: amplitudes grow faster than below."""
        return bool(self.z < -CHANGES)

    @property
    def failing(self) -> float:
        """Confidence, 0 to 1, that p falls: 1 from the change that is reported, 0 up to half of it."""
        return float(np.clip(np.nan_to_num(-self.z) / (0.5 * CHANGES) - 1.0, 0.0, 1.0))


def trend(data: Observations, scatter: float, expected: tuple[float, float] | None = None) -> Trend:
    """Local exponents of the tested resonances, repeats of a level averaged.

    Args:
        scatter: relative scatter of one sweep's resonant amplitude; for a decay, of its force.
        expected: scatter by which a change is judged, and the degrees of freedom it is worth; by default ``scatter``,
            as known. (That of a fit of laws is not known: the fit may take a change for scatter.)
    """
    levels, of_decay = data.levels, data.amplitude_is_input
    count = np.bincount(levels)
    each_F, each_A = np.log(data.tested_force), np.log(data.tested_amplitude)
    log_F, log_A = (np.bincount(levels, v) / count for v in (each_F, each_A))
    step_F, step_A = np.diff(log_F), np.diff(log_A)
    with np.errstate(divide="ignore", invalid="ignore"):
        p = np.where(step_A > 0.0, step_F / step_A, np.nan)
        slope = (1.0 if of_decay else p) / step_A  # change of p with the scattering quantity: decay ln F, else ln A
    sd = np.abs(slope) * scatter * np.sqrt(1.0 / count[:-1] + 1.0 / count[1:])
    force = np.exp(0.5 * (log_F[:-1] + log_F[1:]))
    if len(p) < 2 or np.isnan(p).any():
        return Trend(force, p, sd, np.nan)
    known = expected or (scatter, _CERTAIN)
    z = find_change(each_A, each_F, levels, *known) if of_decay else -find_change(each_F, each_A, levels, *known)
    return Trend(force, p, sd, z)  # p falls where ln A(ln F) bends upwards


def find_change(x: FloatArray, y: FloatArray, levels: IntArray, scatter: float, freedom: float) -> float:
    """Change of the slope of y(x) as a standard normal deviate; x, y, ``levels`` of each sweep: (sweeps,).

    Beside a straight line, y has a parabola, or a step at the top level: a bend between the two highest. The least
    squares S that n sweeps leave beside either give s^2 = (``freedom`` ``scatter``^2 + S)/(``freedom`` + n - 3), and
    the change over its standard deviation follows Student's t; over that by a scatter of ``MOST``, it is at most as
    probable as a normal deviate. The least probable counts, times ``LOOKS`` (Bonferroni).
    """
    line, left = np.column_stack([x - x.mean(), np.ones(len(x))]), len(x) - 3
    found = []
    for shape in (line[:, 0] ** 2, levels == levels.max()):  # with three levels both are the same
        design = np.column_stack([shape, line])
        covariance = np.linalg.inv(design.T @ design)
        fitted = covariance @ design.T @ y
        change, squares = fitted[0] / np.sqrt(covariance[0, 0]), np.sum((y - design @ fitted) ** 2)
        own = np.sqrt((freedom * scatter**2 + squares) / (freedom + left))
        tail = min(stdtr(freedom + left, -abs(change) / own), ndtr(-abs(change) / max(MOST, scatter)))
        found.append((tail * (LOOKS if left else 1.0), change))
    tail, change = min(found)
    return float(np.copysign(ndtri(np.clip(tail, _TINY, 0.5)), change))


#: Fewest levels for predictions beyond ``NEAREST`` times the largest tested force.
ENOUGH_LEVELS = 3
#: Largest force, over the largest tested force, that fewer levels allow.
NEAREST = 1.5
#: Relative excess of a force over the limit that still counts as the limit.
ROUNDING = 1e-3


@dataclass(frozen=True)
class Plan:
    """Laws, weights and limits of a prediction.

    Attributes:
        data: rows near resonance. laws: by weight on these rows, largest first. trend: local exponents. limit: force
            beyond which predictions are refused; infinite if there is none. fit: whether the leading law fits the
            levels. bistable: caution, empty if there is none or the mass is unknown. joint: evidence of the levels'
            frequencies for a slipping joint. excluded: laws that rows away from resonance contradict. state: the
            mass for which predictions hold, if the levels had several.
    """

    data: Observations
    laws: tuple[Candidate, ...]
    trend: Trend
    limit: float
    fit: FitVerdict
    bistable: str = ""
    joint: JointEvidence = ANY_JOINT
    excluded: str = ""
    state: str = ""
    units: Units | None = None

    @property
    def described_limit(self) -> str:
        """The limit with the name of its quantity, and its unit if that is known."""
        units = self.units or Units()
        return f"{units.drive} {self.limit:.4g} {units.force}".rstrip()

    def allows(self, force: Floats) -> BoolArray:
        """Whether predictions are given at a force, or at each of several, with the margin ``ROUNDING``."""
        return np.asarray(force <= self.limit * (1.0 + ROUNDING))


def plan_loads(
    data: Observations,
    laws: Sequence[Law],
    seed: int = 0,
    done: Callable[[str], None] = lambda name: None,
    mode: Mode | None = None,
    estimate: Estimate = evidence,
) -> Plan:
    """Choose and weigh laws for predictions beyond the test.

    Args:
        data: rows near resonance (``near_resonance``).
        laws: candidates.
        done: called with each candidate's name.
        mode: its mass shows whether the mode is bistable and whether a joint slips.
        estimate: of marginal likelihoods and posteriors.

    Raises:
        AnalysisError: no candidate can carry the measured forces.
    """
    resonating = [law for law in laws if law.has_resonance]  # for a decay, friction alone may be ranked
    ranked = weigh_laws(data, seed, resonating or laws, done, estimate)
    planned = tuple(row for row in ranked.candidates if row.evidence)
    scatter = np.hypot(*planned[0].coordinates.scatter(planned[0].weighed.draws))
    repeats = (mode and mode.repeatability.amplitude) or 0.0
    stated = float(np.sqrt(repeats**2 + np.mean(data.sd_amplitude**2 + data.sd_force**2)))
    few = data.levels.max() + 1 < ENOUGH_LEVELS
    bistable, joint = read_resonances(data, mode) if mode else ("", ANY_JOINT)
    exponents = trend(data, float(np.median(scatter)), (stated, _CERTAIN) if stated > MOST else EXPECTED)
    if joint.informative and joint.probability < JOINTS:
        joint = joint._replace(failing=exponents.failing)
    return Plan(
        data=data,
        laws=planned,
        trend=exponents,
        limit=float(NEAREST * data.tested_force.max()) if few else np.inf,
        fit=ranked.fit,
        bistable=bistable,
        joint=joint,
        state=describe_state(data, mode) if mode else "",
        units=mode.units if mode else None,
    )
