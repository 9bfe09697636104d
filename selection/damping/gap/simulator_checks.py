"""Checks of a user's own simulation: repeatable answers, in the units of the mode, to frequencies in Hz."""

import numpy as np
import pandas as pd

from damping.arrays import RAD_S_PER_HZ, FloatArray
from damping.errors import InputError
from damping.gap.simulator import Simulator
from damping.records import audit
from damping.records.check_units import LARGEST_TOLERANCE
from damping.records.record import Record
from damping.records.text import per_cent

#: Checks of the audit that a simulator's answer must pass; others depend on the forces and frequencies asked for.
MUST_PASS = ("units", "phase-unit", "phase-sign")
REPEATED = 1e-6  #: largest relative difference of two answers to one call: over a tolerance of 1 %, 1e-4 of a slope
#: Factors between the frequencies that a simulator is given and those that it takes, and on its response there, by the
#: mistake: a unit of all frequencies, or of those in a stiffness m omega_n^2 alone.
MISTAKEN = {
    "2 pi times the frequencies": (RAD_S_PER_HZ, 1.0),
    "1/(2 pi) times the frequencies": (1.0 / RAD_S_PER_HZ, 1.0),
    "1/(2 pi) times the frequencies, with 1/(2 pi)^2 of its response": (1.0 / RAD_S_PER_HZ, RAD_S_PER_HZ**-2.0),
    "2 pi times the frequencies, with (2 pi)^2 times its response": (RAD_S_PER_HZ, RAD_S_PER_HZ**2.0),
}
#: Beginning of the caution on such a mistake: no number of a diagnosis means much before that is settled.
RESEMBLES = "the simulation resembles the test at"
#: Median |ln(simulated/measured response)| from which such a mistake is tried: a factor of e in the response.
FAR = 1.0
#: A mistake is reported if frequencies times its factor reduce that median below this share: by more than half, which
#: allows the simulated resonance to be some 1 % off.
NEARER = 0.5


def check_simulator(simulator: Simulator, record: Record) -> tuple[str, ...]:
    """Audit the answer of a simulation to the forces and frequencies of a record; cautions on its unit of frequency.

    InputError: two answers to one call, units other than the mode's, a phase that is no lag in radians.
    """
    asked = record.frame.drop_duplicates(["sweep", "force", "frequency"], ignore_index=True)
    force, frequency = asked[["force", "frequency"]].to_numpy(dtype=np.float64).T
    A, phase = simulator.answer(force, frequency, {})
    again, turned = simulator.answer(force, frequency, {})
    if (apart := float(np.max(np.abs(again * np.exp(1j * (turned - phase)) / A - 1.0)))) > REPEATED:
        what = f"the simulator answers the same call twice, {100.0 * apart:.2g} % apart"
        raise InputError(what, expected="one answer to one question: fix the seed, or let it converge further")
    answer = Record(asked[["sweep", "force", "frequency"]].assign(amplitude=A, phase=phase), "the simulator's answer")
    for finding in audit(answer, simulator.mode).findings:
        if finding.verdict == "refuse" and finding.check in MUST_PASS:
            what = f"{finding.what}; {finding.advice}"
            raise InputError(what, file=answer.source, expected="amplitudes and lags of a structure")
    return (*_doubt_tolerances(simulator), *_doubt_frequency(simulator, asked, _measure_distance(asked, A, phase)))


def _doubt_tolerances(simulator: Simulator) -> list[str]:
    """A caution on tolerances larger than the values, as per cents taken for shares are."""
    named = simulator.tolerances.items()
    large = [f"{per_cent(100.0 * by)} % of {name}" for name, by in named if by > LARGEST_TOLERANCE]
    what = f"the simulator states a tolerance of {' and of '.join(large)}"
    return [f"{what}: is it in per cent? 0.02 is 2 %"] if large else []


def _doubt_frequency(simulator: Simulator, asked: pd.DataFrame, apart: float) -> tuple[str, ...]:
    """A caution where a simulation that is far ``apart`` from the test is near it at frequencies in another unit."""
    force, frequency = asked[["force", "frequency"]].to_numpy(dtype=np.float64).T
    for name, (factor, share) in MISTAKEN.items() if apart > FAR else ():
        try:
            A, phase = simulator.answer(force, factor * frequency, {})
        except InputError:  # it need not answer there
            continue
        if _measure_distance(asked, share * A, phase) < NEARER * apart:
            what = "its stiffness" if share != 1.0 else "it"
            remark = f"is there a mistake of rad/s for Hz in {what}? It is given Hz"
            return (f"{RESEMBLES} {name}: {remark}",)
    return ()


def _measure_distance(measured: pd.DataFrame, A: FloatArray, phase: FloatArray) -> float:
    """Median |ln| of simulated over measured complex response; of the amplitudes alone where no phase was measured."""
    turn = phase - measured["phase"].to_numpy(dtype=np.float64) if "phase" in measured else np.zeros_like(A)
    return float(np.median(np.abs(np.log(A / measured["amplitude"].to_numpy(dtype=np.float64) * np.exp(-1j * turn)))))
