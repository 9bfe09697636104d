"""Chapter III in the report: conditioning (3.1), the mode in two planes, damping factors with all their roots (3.2)."""

from __future__ import annotations

import numpy as np
import pandas as pd

from damping.report.page import Block, Heading, Text
from damping.report.words import NOTHING, between, count, joined, number, percent, points_text
from damping_reed1970.chapter_3 import PLANES
from damping_reed1970.chapter_3.captions import change_by_conditioning, chapter_3_figures
from damping_reed1970.chapter_3.planar_fits import LEVEL, SAMPLED
from damping_reed1970.chapter_3.study import Chapter3
from damping_reed1970.common import Figures, ReportPart, agreement_text, figure, folded, of_chapter, part, row, table
from damping_reed1970.studies import ReportResults


def chapter_3(results: ReportResults) -> ReportPart:
    """The part: accelerometers to modal motion, planar coupling fitted, and every damping factor that balances."""
    found = results.chapter_3
    figures = {one.name: one for one in chapter_3_figures(found)}
    blocks: list[Block] = [
        Text(
            "Configuration I was swept once, over its second mode. Section 3.1 turns tail and tip accelerations into "
            "modal amplitude and phase and removes rigid-body rotation and adjacent modes. It derives the "
            "planar-coupled oscillator that explains the warped curve left over, and stops there: finding its "
            "parameters is “not within the scope of this study”. Section 3.2 assumes the two planes and finds a "
            "damping factor for each point by trial and error."
        ),
        Text(agreement_text(of_chapter(results.tables["reproduction"], 3))),
        *_conditioning(found, figures),
        *plane_blocks(found, figures),
        *_roots(found, figures),
    ]
    return part(3, "Chapter III: one mode in two planes", blocks, found.tables)


def _conditioning(found: Chapter3, figures: Figures) -> list[Block]:
    chain = found.tables["conditioned"]
    amplitude = 100.0 * (chain["A_2"] / chain["A_2_printed"] - 1.0).abs().max()
    phase = (chain["phi_2"] - chain["phi_2_printed"]).abs().max()
    largest, at_peak = change_by_conditioning(found.effect)
    removed = found.tables["removed"].drop(columns=["point", "omega"])
    total = removed.sum(axis=1).abs()
    return [
        Heading("3.1: from accelerometers to the second mode"),
        Text(
            f"One chain of {count(len(found.steps), 'step')} from the raw table gives every modal amplitude of Table "
            f"3.III within {number(amplitude, 2)} per cent and every phase within {number(phase, 2)} rad. What it "
            f"takes away, {between(total.min(), total.max(), 'inches', 2)} in phase with the force, changes the "
            f"amplitude by up to {percent(largest)} per cent, and by {percent(at_peak)} per cent at its peak"
            + (": conditioning moves the skirts, not the resonance." if at_peak < 0.1 * largest else ".")
        ),
        figure(figures, "tail-displacement", 3),
        figure(figures, "tail-phase-sine", 3),
        figure(figures, "phase-angles", 3),
        figure(figures, "modal-amplitude", 3),
        figure(figures, "conditioning-effect", 3),
        folded(
            "Tables 3.I and 3.III, printed and computed, and what each step removed",
            table(
                3,
                "conditioned",
                chain,
                "Displacements, correction, modal phase (rad) and amplitude (in) by point: printed (corrected where an "
                "erratum is known) and computed from the raw table.",
            ),
            table(
                3, "removed", found.tables["removed"], "Motion in phase with the force that was removed, modal inches."
            ),
        ),
    ]


def _roots(found: Chapter3, figures: Figures) -> list[Block]:
    branches, fitted = found.tables["branches"], found.tables["branches_fitted"]
    shown = ["point", "omega", "energy", "largest_energy", "roots", "xi_low", "xi_high", "xi_printed", "taken"]
    headings = {"omega": "ω, rad/s", "energy": "energy in, in-lb", "largest_energy": "largest that can be lost",
                "xi_low": "low root ξ", "xi_high": "high root ξ", "xi_printed": "printed ξ"}  # fmt: skip
    return [
        Heading("3.2: the damping factor has two values, or none"),
        Text(" ".join(_two_roots(branches, fitted))),
        figure(figures, "damping-roots", 3),
        Text(_means(found.tables["branch_means"], branches)),
        table(
            3,
            "branch_means",
            found.tables["branch_means"],
            "Mean damping factor and mean linear coefficient C₁ (Eq. 3.2.18, lb s/in) on each branch.",
            {"C_1": "C₁", "mean_xi": "mean ξ"},
        ),
        table(3, "branches", branches[shown], "All roots of Eq. 3.2.15, and which the report took.", headings),
        figure(figures, "input-energy", 3),
        figure(figures, "principal-amplitudes", 3),
        folded(
            "The same with the planes that fit, and the energies of both branches",
            table(
                3, "branches_fitted", fitted[shown], "Roots of Eq. 3.2.15 with the planes of the free fit.", headings
            ),
            table(
                3,
                "branches",
                branches[
                    [
                        "point",
                        "energy_printed",
                        *(c for c in map(str, branches) if c.startswith(("pitch", "yaw", "A_"))),
                    ]
                ],
                "Energy lost in each plane, in-lb, and pitch amplitude, in, on each branch.",
            ),
        ),
    ]


def _two_roots(branches: pd.DataFrame, fitted: pd.DataFrame) -> list[str]:
    """How many roots there are, which were taken, and what other planes give."""
    two, none = branches[branches["roots"] == 2], branches[branches["roots"] == 0]
    taken = {name: points_text(branches.loc[branches["taken"] == name, "point"]) for name in ("low", "high")}
    ratio = (two["xi_high"] / two["xi_low"]).max()
    return [
        "The energy lost rises with the damping factor to a maximum and falls again, so an energy below the maximum "
        f"is balanced by two damping factors and one above it by none. Eq. 3.2.15 has two roots at {len(two)} of "
        f"{len(branches)} points, up to {number(ratio, 2)} times apart, and none at {points_text(none['point'])} "
        "(erratum "
        f"E3IV-1). Trial and error took the low root at {taken['low']} and the high one at {taken['high']}.",
        "With the planes that fit amplitude and phase instead of those assumed there is none at "
        f"{points_text(fitted.loc[fitted['roots'] == 0, 'point'])}.",
    ]


def _means(means: pd.DataFrame, branches: pd.DataFrame) -> str:
    """What the mean coefficient is worth."""
    printed = row(means, choice="as printed")
    low, high = row(means, choice="every low root"), row(means, choice="every high root (below .05, else low)")
    near = branches["xi_printed"].min(), branches["xi_printed"].max()
    return (
        f"The mean coefficient {number(printed['C_1'])} lb s/in (3.2.18) and the growth of ξ towards resonance "
        f"(printed {between(*near)}) rest on that choice: every low root gives {number(low['C_1'])}, every high root "
        f"{number(high['C_1'])}."
    )


#: Parameters of a fit as the page shows them, with the digits after the point.
SHOWN = {
    "omega_p": ("ω_p, rad/s", 3),
    "omega_y": ("ω_y, rad/s", 3),
    "theta_degrees": ("θ, degrees", 1),
    "M": ("M, lb s²/in", 2),
    "C": ("C, lb s/in", 2),
    "xi": ("ξ", 5),
    "in_phase_in": ("in phase, in", 3),
    "lag_rad": ("lag, rad", 3),
}
#: The same of a posterior.
POSTERIOR = {"theta": "theta_degrees", "R": "in_phase_in"}
HELD = "theta = 28, M = 21"
FREE = "free"


def plane_blocks(found: Chapter3, figures: Figures) -> list[Block]:
    """Fits of the planar oscillator, their posteriors, and what they imply."""
    tables = found.tables
    fits, posteriors = tables["planar_fits"], tables["planar_posteriors"]
    main = fits[(fits["data"] == "A2") & (fits["noise"] == "constant")]
    return [
        Heading("3.1: the planar-coupled oscillator, fitted"),
        Text(_fits(fits, posteriors)),
        figure(figures, "planar-fit", 3),
        table(
            3, "planar_fits", fit_rows(main), "Fits to the modal motion of Table 3.III with standard errors. " + _NOTE
        ),
        table(
            3,
            "planar_posteriors",
            posterior_rows(posteriors),
            f"Posterior medians with {100 * LEVEL:g} per cent intervals, of the modal motion (A2) and of the tail with "
            "nothing removed but motion in phase with the force fitted.",
        ),
        Text(_evidence(tables["planar_evidence"], posteriors)),
        figure(figures, "planar-posterior", 3),
        figure(figures, "yaw-amplitude", 3),
        table(3, "implications", tables["implications"], "What the fits imply for the report's assumptions.", _WORDS),
        folded(
            "Every fit, the evidence, and yaw motion and energy by point",
            table(
                3,
                "planar_fits",
                fit_rows(fits, ["data", "noise"]),
                "Fits to both data with both kinds of noise. " + _NOTE,
            ),
            table(3, "planar_evidence", tables["planar_evidence"], "Log marginal likelihood of each variant."),
            table(3, "planar_posteriors", posteriors, "Every posterior, and how well it is known."),
            table(3, "yaw", tables["yaw"], "Yaw amplitude, measured and predicted by fits that have not seen it, in."),
            table(3, "energy_split", tables["energy_split"], "Share of the energy lost in the yaw plane, per cent."),
        ),
    ]


_NOTE = (
    "Chi-square is against the fit with all parameters free; its p-value takes the correlation of neighbouring "
    "residuals into account."
)
_WORDS = {"says": "in words"}


def fit_rows(fits: pd.DataFrame, head: list[str] | None = None) -> pd.DataFrame:
    """A row a fit: parameters with standard errors as text, those held without."""
    columns: dict[str, object] = {name: fits[name] for name in [*(head or []), "fit"]}
    for name, (label, digits) in SHOWN.items():
        pairs = fits[[name, f"{name}_se"]].to_numpy(float)
        columns[label] = [_with_error(value, error, digits) for value, error in pairs]
    columns["residual, in"] = fits["sigma"]
    columns["chi-square"] = fits["chi_square"]
    columns["p-value"] = fits["p_value_correlated"]
    return pd.DataFrame(columns)


def posterior_rows(posteriors: pd.DataFrame) -> pd.DataFrame:
    """A row a sampled posterior, each parameter as median and interval."""
    rows = []
    for data, fit in SAMPLED:
        mine = posteriors[(posteriors["data"] == data) & (posteriors["fit"] == fit)]
        spoken = {"data": data, "fit": fit}
        for one in mine.to_dict("records"):
            label, digits = SHOWN.get(POSTERIOR.get(one["parameter"], one["parameter"]), ("", 0))
            if label:
                spoken[label] = (
                    f"{one['median']:.{digits}f} ({one['low']:.{digits}f} to {one['high']:.{digits}f})".replace(
                        "-", "−"
                    )
                )
        rows.append(spoken)
    return pd.DataFrame(rows).fillna("")[
        ["data", "fit", *(label for label, _ in SHOWN.values() if label != "lag, rad")]
    ]


def _with_error(value: float, error: float, digits: int) -> str:
    """``11.393 ± 0.004``; a value that is held alone, nothing for a part that is not there."""
    if np.isnan(value) or (value == 0.0 and error == 0.0):
        return NOTHING
    text = f"{value:.{digits}f}".replace("-", "−")
    return text if error == 0.0 else f"{text} ± {error:.{digits}f}"


def _fits(fits: pd.DataFrame, posteriors: pd.DataFrame) -> str:
    """The report's planes and ours."""
    free, held = (row(fits, data="A2", noise="constant", fit=fit) for fit in (FREE, HELD))
    theta = row(posteriors, data="A2", fit=FREE, parameter="theta")
    report = float(np.degrees(PLANES.theta))
    side = "inside" if theta["low"] <= report <= theta["high"] else "outside"
    off = [abs(held[name] - value) / held[f"{name}_se"] for name, value in _FREQUENCIES.items()]
    return (
        f"The report takes an angle of {report:.0f} degrees between force and pitch plane and a modal mass of "
        f"{PLANES.mass:g} lb s²/in, and reads the frequencies {PLANES.omega_p:.2f} and {PLANES.omega_y:.2f} rad/s off "
        "the two peaks of the tail. Fitted to amplitude and phase together with angle and mass held, the frequencies "
        f"come out as {_pair(held, 'omega_p', 3)} and {_pair(held, 'omega_y', 3)} rad/s, within {number(max(off), 2)} "
        f"standard errors of that. With all five parameters free they are {_pair(free, 'omega_p', 3)} and "
        f"{_pair(free, 'omega_y', 3)} rad/s, the angle is {_pair(free, 'theta_degrees', 1)} degrees and the mass "
        f"{_pair(free, 'M', 1)}. The posterior of the angle, {between(theta['low'], theta['high'])} degrees "
        f"({100 * LEVEL:g} per cent), has the {report:.0f} degrees of a stiffness analysis {side}."
    )


_FREQUENCIES = {"omega_p": PLANES.omega_p, "omega_y": PLANES.omega_y}


def _pair(fit: pd.Series[float], name: str, digits: int) -> str:
    return _with_error(float(fit[name]), float(fit[f"{name}_se"]), digits)


def _evidence(evidence: pd.DataFrame, posteriors: pd.DataFrame) -> str:
    """What the data say for and against each assumption."""
    factors = evidence.set_index("fit")["bayes_factor_over_free"]
    phase = row(posteriors, data="A2", fit="free + in phase", parameter="R")
    agree = [
        f"θ {between(one['low'], one['high'])}"
        for one in (row(posteriors, data=data, fit="free + in phase", parameter="theta") for data in ("A2", "tail"))
    ]
    planes = f"Two planes are favoured {number(1.0 / factors['one plane'], 2)} to 1 over one."
    if factors[HELD] < 1.0:
        odds = number(1.0 / factors[HELD], 2)
        return f"{planes} All parameters free are favoured {odds} to 1 over the report's angle and mass."
    return (
        f"{planes} Holding the report's angle "
        f"and mass is favoured {number(factors[HELD], 2)} to 1 over leaving all free under wide priors, so the "
        "report's choice is no worse an account of this one sweep. What asks for more is motion in phase with the "
        f"force that the conditioning left in: {between(phase['low'], phase['high'], 'in', 2)}, favoured "
        f"{number(factors['free + in phase'], 2)} to 1; with it the tail and the conditioned motion tell of the same "
        f"planes ({joined(agree)} degrees)."
    )
