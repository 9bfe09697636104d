"""Tests that could be made next: the sweeps that a record can hold, the mildest first."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import chain
from math import sqrt

import numpy as np

from damping.effects.contract import Terms
from damping.gap.model import Problem
from damping.gap.rows import UNSEEN, PhasorRows

_POINTS = 40  #: rows of a proposed sweep
#: Masses added for a second state, as shares of the modal mass.
ADDED_MASSES = (0.2, 0.5)
FLOOR = 3e-4  #: noise of a harmonic analyser over the largest amplitude
THIRD = ("amplitude_3", "phase_3")  #: columns of a third harmonic


@dataclass(frozen=True)
class ProposedTest:
    """A test that could be made next: ``what`` it is, ``why`` it discriminates, ``columns`` beside those of a sweep."""

    what: str
    why: str
    columns: tuple[str, ...] = ()
    width: float = 1.0  #: of the sweep over that of the record, 0 for the vicinity of resonance
    factor: float = 1.0  #: on the highest force, or on the ``lowest``
    lowest: bool = False
    heavier: float = 0.0  #: added mass over the modal mass
    channel: str = ""  #: further channel that is measured
    change: Callable[[Terms], Terms] = lambda terms: terms  #: change of the terms of any hypothesis in this test

    def joins(self, other: "ProposedTest") -> bool:
        """Whether both can be rows of one table, since a change of the terms holds for all, and are different runs."""
        runs = [(test.width, test.factor, test.lowest, test.heavier) for test in (self, other)]
        one_run = runs[0] == runs[1] and (not self.channel or not other.channel)
        return not one_run and "sweep_rate" not in {*self.columns, *other.columns}

    def plan(self, problem: Problem) -> PhasorRows:
        """The rows of the test, taken after the record, with amplitudes of the repeated sweep at equal detuning.

        A further channel has its noise in the record; else that of the smallest amplitudes, or `FLOOR`.
        """
        rows, scales = problem.rows.where(problem.rows.state == 0.0), problem.scales
        level = rows.levels.min() if self.lowest else rows.levels.max()
        again = rows.where(rows.sweep == np.flatnonzero(rows.levels == level)[0])
        reach, middle = self.width * max(scales.reach, 4.0 * scales.bandwidth), 1.0
        if not self.width:  # about the resonance of that level, which a nonlinear spring moves
            reach = 2.0 * min(scales.bandwidth, scales.reach or scales.bandwidth)
            middle = float(again.omega[np.argmax(again.u)]) / scales.omega_n
        band = middle * (1.0 + np.maximum(np.linspace(-1.0, 1.0, _POINTS) * reach, -0.8))
        planned = again.take_rows(np.argmin(np.abs(again.omega[:, np.newaxis] - scales.omega_n * band), axis=0))
        u = planned.u + np.log(self.factor)
        F, added = float(np.median(again.bare_force)) * self.factor, self.heavier * scales.M
        shaken = float(np.median(again.shaken))
        sd_amplitude = float(np.median(again.sd_amplitude))
        floor = min(float(np.min(sd_amplitude * np.exp(u))), FLOOR * float(np.max(np.exp(u))))
        sd = {name: np.full(_POINTS, UNSEEN) for name in ("third", "cross")}
        if self.channel:
            known = float(getattr(rows, f"sd_{self.channel}").min())
            sd[self.channel] = np.full(_POINTS, known if known < UNSEEN else floor)
        turn = np.arange(_POINTS)[:: 1 if again.up[0] > 0.0 else -1]
        return replace(
            planned,
            row=np.arange(_POINTS),
            sweep=np.zeros(_POINTS, dtype=np.int64),
            F=np.full(_POINTS, F * (1.0 + added / shaken) if shaken else F),
            omega=scales.omega_n * band / sqrt(1.0 + self.heavier),
            u=u,
            resonant=np.zeros(_POINTS, dtype=bool),
            time=0.5 + (1.0 + turn) / max(len(rows) - 1, 1),
            label=np.zeros(_POINTS),
            rate=planned.rate * ("sweep_rate" not in self.columns),
            added=np.full(_POINTS, added),
            sd_amplitude=np.full(_POINTS, sd_amplitude),
            sd_phase=np.full(_POINTS, float(np.median(again.sd_phase))),
            sd_third=sd["third"],
            sd_cross=sd["cross"],
            channels=(self.channel,) if self.channel else (),
        )


def _with_third(design: ProposedTest) -> ProposedTest:
    return replace(
        design,
        what=f"{design.what}, with the third harmonic of the displacement",
        why=f"{design.why}; nonlinear forces distort the motion, other modes and gains do not",
        columns=(*design.columns, *THIRD),
        channel="third",
    )


def _add_mass(share: float) -> ProposedTest:
    """A second state, at a force tested in the first: at another force, errors of force and mass read alike."""
    return ProposedTest(
        f"a second state with a known mass of {100 * share:g} % of the modal mass added",
        "it shifts the frequency and determines the modal mass, and with it every factor on force and amplitude",
        ("added_mass",),
        heavier=share,
    )


#: Tests of the displacement along the drive, the mildest first.
_ALONG = (
    ProposedTest("a sweep at the highest force", "it can be compared directly with a tested level"),
    ProposedTest(f"{_POINTS} more points near resonance at the highest force", "damping dominates there", width=0.0),
    ProposedTest(
        "a sweep at half the lowest force", "effects differ in their dependence on amplitude", factor=0.5, lowest=True
    ),
    ProposedTest(
        "a sweep of twice the band at the highest force",
        "other modes and other powers of frequency are visible far from resonance",
        width=2.0,
    ),
    *map(_add_mass, ADDED_MASSES),
    ProposedTest(
        "a sweep at twice the highest force, if rig and structure allow it",
        "effects differ in their dependence on amplitude",
        factor=2.0,
    ),
)
#: All tests that a record can hold, the mildest first.
DESIGNS = (
    ProposedTest(
        "the highest sweep again, each frequency held until the motion is steady",
        "it removes the effect of a moving frequency",
        ("sweep_rate",),
        change=lambda terms: terms._replace(moving=()),
    ),
    ProposedTest(
        "the motion across the measured axis at the highest force",
        "only a second principal plane causes motion across the drive",
        ("amplitude_y", "phase_y"),
        channel="cross",
    ),
    *chain.from_iterable((design, _with_third(design)) for design in _ALONG),
)
