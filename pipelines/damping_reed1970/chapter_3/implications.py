"""What the test of Configuration I says of the assumptions of chapter III: fits of both planes, and answers in numbers.

Two pictures of one test: the modal motion of Table 3.III (``A2``), from which the report had removed rigid-body
rotation and adjacent modes, and the tail motion over the mode factor (``tail``), from which nothing is removed. Each
assumption of the report is a question with its answer, a row each.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import degrees

import numpy as np
import pandas as pd
from scipy.stats import chi2

from damping.arrays import FloatArray
from damping.signals import viscous_energy
from damping_reed1970 import columns, load_table
from damping_reed1970.chapter_3 import PLANES, PlanarOscillator, yaw_response
from damping_reed1970.chapter_3.planar_fit import VARIANTS, Noise, Phasors, PlanarFit, fit_planar, phasors
from damping_reed1970.chapter_3.planar_posterior import LEVEL, TAILS, PlanarPosterior, Posteriors

NOISES: tuple[Noise, Noise] = ("constant", "proportional")
#: Fits by data, noise and variant.
Fits = Mapping[tuple[str, str, str], PlanarFit]
#: Where the report's second frequency (Eq. 3.1.37) may lie when it is read off a plot to .01 or two: asked of omega_y.
SECOND_PLANE = (11.48, 11.51)
REPORT = "theta = 28, M = 21"
#: A question with its answer: ``question, value, says`` and, where there is an interval, ``low, high``.
Answer = dict[str, str | float]


def planar_fits() -> dict[tuple[str, str, str], PlanarFit]:
    """All fits of both pictures with both noises."""
    return {
        (name, noise, variant): fit_planar(phasors(name, noise), *arguments)
        for name in ("A2", "tail")
        for noise in NOISES
        for variant, arguments in VARIANTS.items()
    }


def fit_table(fits: Fits) -> pd.DataFrame:
    """One row a fit: parameters with standard errors (``_se``; theta in degrees), quality, comparison with ``free``.

    ``in_phase_in``: motion R F at the mean force. ``chi_square`` = 2 n ln(SSE/SSE of ``free``), negative where a fit
    has more parameters than that; ``p_value`` of its size with the difference in parameters as degrees of freedom, and
    ``p_value_correlated`` with chi_square reduced for the correlation r of neighbouring residuals, by (1 - r)/(1 + r)
    of the larger model.
    """
    return pd.DataFrame([_fit_row(key, fit, fits[(*key[:2], "free")]) for key, fit in fits.items()])


def _fit_row(key: tuple[str, str, str], fit: PlanarFit, free: PlanarFit) -> dict[str, float | str]:
    name, noise, variant = key
    force = float(phasors(name).F.mean())
    scales = {"theta": degrees(1.0), "R": force}
    labels = {"theta": "theta_degrees", "R": "in_phase_in", "lag": "lag_rad"}
    row: dict[str, float | str] = {"data": name, "noise": noise, "fit": variant}
    values = {**fit.model._asdict(), "xi": fit.xi}
    for parameter in ("omega_p", "omega_y", "theta", "M", "C", "xi", "R", "lag"):
        label, scale = labels.get(parameter, parameter), scales.get(parameter, 1.0)
        row[label] = scale * float(values[parameter])
        row[f"{label}_se"] = scale * fit.standard_errors[parameter]
    if variant == "one plane":
        row["omega_y"] = np.nan
    quality = {"sigma": fit.sigma, "SSE": fit.SSE, "correlation": fit.correlation, "parameters": len(fit.fitted)}
    return {**row, **quality, **comparison(fit, free)}


def comparison(fit: PlanarFit, free: PlanarFit) -> dict[str, float]:
    """Chi-square of a fit against another that contains it or is contained, and what probability it has by chance."""
    larger = max(fit, free, key=lambda either: len(either.fitted))
    chi_square, freedom = fit.chi_square_over(free), abs(len(free.fitted) - len(fit.fitted))
    left = (1.0 - larger.correlation) / (1.0 + larger.correlation)
    p = [float(chi2.sf(abs(chi_square) * share, freedom)) if freedom else np.nan for share in (1.0, min(1.0, left))]
    return {"chi_square": chi_square, "p_value": p[0], "p_value_correlated": p[1]}


def tabulate_yaw(fits: Fits) -> pd.DataFrame:
    """Yaw amplitude by point: measured (Table 3.I, tail yaw over the mode factor), and predicted by fits to pitch."""
    motion = load_table("3_I", "corrected")
    omega, yaw = columns(motion, "omega_rad_s", "tail_yaw_disp_in_e2")
    data = phasors("A2")
    predicted = {
        variant: np.abs(yaw_response(fits["A2", "constant", variant].model, data.F, data.omega))
        for variant in ("free", "theta = 28, M = 21", "free + in phase + lag")
    }
    return pd.DataFrame({"point": motion["point"], "omega": omega, "measured": yaw / 100 / PLANES.phi, **predicted})


def tabulate_energy_split(fits: Fits) -> pd.DataFrame:
    """Share of the energy that the yaw plane takes, in per cent by point: Table 3.IV as printed, and two fits."""
    table = load_table("3_IV").query("corrected_row == 0")
    pitch, yaw = columns(table, "energy_pitch_in_lb", "energy_yaw_in_lb")
    data = phasors("A2")
    shares = {v: _yaw_share(fits["A2", "constant", v].model, data) for v in ("free", "theta = 28, M = 21")}
    printed = 100.0 * yaw / (pitch + yaw)
    return pd.DataFrame({"point": table["point"].to_numpy(), "omega": data.omega, "printed": printed, **shares})


def _yaw_share(model: PlanarOscillator, data: Phasors) -> FloatArray:
    """Per cent of the energy lost that is lost in the yaw plane, (n,)."""
    M, C, omega_p, omega_y, theta = (float(value) for value in model[:5])
    energies = []
    for omega_j, part in ((omega_p, np.cos(theta)), (omega_y, np.sin(theta))):
        A = np.abs(part * data.F / (M * (omega_j**2 - data.omega**2) + 1j * C * data.omega))
        energies.append(viscous_energy(A, M, omega_j, C / (2.0 * M * omega_j), data.omega))
    return np.asarray(100.0 * energies[1] / (energies[0] + energies[1]))


def tabulate_implications(fits: Fits, posteriors: Posteriors) -> pd.DataFrame:
    """Columns ``question, value, low, high`` (interval where there is one, else NaN) and ``says``."""
    answers = [
        *_assess_angle(fits, posteriors),
        *_assess_planes(posteriors),
        *_assess_in_phase(fits, posteriors),
        *_assess_yaw(fits),
        _assess_noise(fits),
    ]
    return pd.DataFrame(answers, columns=["question", "value", "low", "high", "says"])


def _assess_angle(fits: Fits, posteriors: Posteriors) -> list[Answer]:
    """The angle of 28 degrees and the mass of 21 against both free."""
    interval = _interval(posteriors["A2", "free"], "theta")
    inside = "inside" if interval["low"] <= 28.0 <= interval["high"] else "outside"
    question = f"theta, degrees: median and {100 * LEVEL:g} % interval"
    says = f"28 degrees, from a stiffness analysis (section 3.1), is {inside} the interval"
    answers: list[Answer] = [{"question": question, "says": says, **interval}]
    for held, free in (("theta = 28", "free"), (REPORT, "free"), ("theta = 28 + in phase", "free + in phase")):
        larger = fits["A2", "constant", free]
        compared = comparison(fits["A2", "constant", held], larger)
        says = (
            f"p = {compared['p_value']:.2g} if the residuals were independent; "
            f"p = {compared['p_value_correlated']:.2g} with the correlation of neighbours, {larger.correlation:.2f}"
        )
        question = f"chi-square of {held} over {free}"
        answers.append({"question": question, "value": compared["chi_square"], "says": says})
    for variant, name in (("theta = 28", "28 degrees"), (REPORT, "28 degrees and a mass of 21")):
        odds = _bayes_factor(posteriors, variant)
        says = f"{name} favoured {1.0 / odds:.1f} to 1: the wide priors of what is free cost more than the fit gains"
        says = says if odds < 1.0 else f"all free favoured {odds:.1f} to 1: next to nothing, the prior of theta pays"
        answers.append({"question": f"Bayes factor of all free over {name}", "value": odds, "says": says})
    return answers


def _assess_planes(posteriors: Posteriors) -> list[Answer]:
    """One plane or two, and where the second is."""
    odds = _bayes_factor(posteriors, "one plane")
    says = "planar coupling is needed"
    answers: list[Answer] = [{"question": "Bayes factor of two planes over one", "value": odds, "says": says}]
    low, high = SECOND_PLANE
    for key, what in ((("A2", "free"), "modal motion"), (("tail", "free + in phase"), "tail, motion in phase free")):
        omega_y, interval = posteriors[key].parameters["omega_y"], _interval(posteriors[key], "omega_y")
        says = "omega_y {value:.3f}, {low:.3f} to {high:.3f} rad/s; 11.50 in Eq. 3.1.37".format_map(interval)
        question = f"probability that omega_y lies in {low} to {high} rad/s ({what})"
        share = float(np.mean((omega_y >= low) & (omega_y <= high)))
        answers.append({"question": question, "value": share, "says": says})
    return answers


def _assess_in_phase(fits: Fits, posteriors: Posteriors) -> list[Answer]:
    """Motion in phase with the force that is left in the modal motion, and all of it in the tail."""
    C_t = load_table("3_III", "corrected")["correction_Ct2_in"].mean()
    free, some, more = (fits["A2", "constant", f"free{added}"] for added in ("", " + in phase", " + in phase + lag"))
    says = {
        "A2": f"chi-square {-comparison(some, free)['chi_square']:.1f} for one parameter: Table 3.III's correction, "
        f"{C_t:.4f} in on average, removes about half of what the phasors ask for",
        "tail": f"minus C_t of Table 3.III is {-C_t:.4f} in on average",
    }
    answers: list[Answer] = [
        {
            "question": f"motion in phase with the force in {data}, in",
            "says": text,
            **_interval(posteriors[data, "free + in phase"], "R"),
        }
        for data, text in says.items()
    ]
    lag, error = float(more.model.lag), 1.645 * more.standard_errors["lag"]
    lag_says = (
        f"chi-square {-comparison(more, some)['chi_square']:.1f} for one parameter more; theta then is "
        f"{np.degrees(more.model.theta):.1f}"
    )
    interval = {"value": lag, "low": lag - error, "high": lag + error}
    question = "lag common to all readings of A2, rad (least squares)"
    return [*answers, {"question": question, "says": lag_says, **interval}]


def _assess_yaw(fits: Fits) -> list[Answer]:
    """The yaw motion, which was measured and not fitted, and the energy it takes."""
    yaw, split = tabulate_yaw(fits), tabulate_energy_split(fits)
    answers: list[Answer] = []
    for variant in ("free", REPORT, "free + in phase + lag"):
        error = float(np.sqrt(np.mean((yaw[variant] - yaw["measured"]) ** 2)))
        says = f"largest predicted {yaw[variant].max():.3f} in, measured {yaw['measured'].max():.3f} in; not fitted"
        question = f"yaw amplitude predicted by {variant}: RMS error, in"
        answers.append({"question": question, "value": error, "says": says})
    energy = load_table("3_IV").query("corrected_row == 0")["energy_input_in_lb"].to_numpy(float)
    shares = {name: float(np.average(split[name], weights=energy)) for name in ("printed", "free", REPORT)}
    says = f"Table 3.IV {shares['printed']:.0f} per cent, the planes of the report fitted {shares[REPORT]:.0f} per cent"
    question = "energy lost in the yaw plane over all points, per cent (free)"
    return [*answers, {"question": question, "value": shares["free"], "says": says}]


def _assess_noise(fits: Fits) -> Answer:
    """How far the residuals are from independent noise."""
    free, more = fits["A2", "constant", "free"], fits["A2", "constant", "free + in phase"]
    peak = float(np.abs(phasors("A2").q).max())
    says = (
        f"residuals of {100.0 * free.sigma / peak:.0f} per cent of the largest amplitude run together: standard errors "
        f"are too small; with motion in phase {more.correlation:.2f} and {100.0 * more.sigma / peak:.0f} per cent"
    )
    return {"question": "correlation of neighbouring residuals (free)", "value": free.correlation, "says": says}


def _bayes_factor(posteriors: Posteriors, variant: str) -> float:
    """Of all free over a variant."""
    return float(np.exp(posteriors["A2", "free"].evidence.log_z - posteriors["A2", variant].evidence.log_z))


def _interval(posterior: PlanarPosterior, name: str) -> dict[str, float]:
    low, median, high = np.quantile(posterior.parameters[name], TAILS).tolist()
    return {"value": median, "low": low, "high": high}
