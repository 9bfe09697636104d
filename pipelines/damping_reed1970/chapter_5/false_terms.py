"""Section 5.3: "a danger exists in including energy losses which do not exist", in numbers.

Energies of a known law, 1.571 A^2 omega + 1.067 A^3 omega on the frequencies and amplitudes of Table 5.II, with
relative noise are given to three ways of selection among five (5.3.2) or nine terms (5.3.6): which terms that are not
there come out, how often, and what that does to the energy at twice the largest amplitude. What
`damping.regression.subsets` does for one response is done here for thousands, with no more than selection needs.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from damping.arrays import BoolArray, FloatArray, IntArray
from damping.plots import AVERAGE, LINEAR, build_panels, styled
from damping.plots.scales import plain_log
from damping_reed1970 import columns, load_table
from damping_reed1970.chapter_5 import GENERATOR, energy_design
from damping_reed1970.chapter_5.nine_terms import NINE_TERMS

BLOCK = 500  #: responses treated at once, for the sake of memory; fewer take longer, more hardly less


@dataclass(frozen=True)
class ManyFits:
    """Models m of responses r on k terms."""

    members: BoolArray  #: (m, k)
    coefficients: FloatArray  #: (m, r, k), 0 for terms left out
    t_ratios: FloatArray  #: (m, r, k), 0 for terms left out
    sse: FloatArray  #: (m, r)
    n: int  #: number of observations of each response

    @property
    def bic(self) -> FloatArray:
        """BIC (m, r) less what all models of a response share: n ln SSE + k ln n."""
        return np.asarray(self.n * np.log(self.sse) + np.log(self.n) * self.members.sum(axis=1)[:, None])

    def best(self, nonnegative: bool = False) -> IntArray:
        """Model of least BIC for each response (r,), of those with every coefficient > 0 if ``nonnegative``; -1 where
        there is none."""
        score = self.bic
        if nonnegative:
            physical = ((self.coefficients > 0.0) == self.members[:, None, :]).all(axis=2)
            score = np.where(physical, score, np.inf)
        return np.where(np.isfinite(score).any(axis=0), score.argmin(axis=0), -1)

    def backward(self, t_stop: float = 2.0) -> IntArray:
        """Model that backward elimination ends with for each response (r,): the term of least |T| is dropped while
        that is below ``t_stop``, down to one term."""
        k = self.members.shape[1]
        weights = 2 ** np.arange(k)
        place = np.full(2**k, -1)
        place[self.members @ weights] = np.arange(len(self.members))
        responses = np.arange(self.sse.shape[1])
        code = np.full(responses.size, 2**k - 1)
        for _ in range(k - 1):
            model = place[code]
            size = np.abs(self.t_ratios[model, responses])
            size[~self.members[model]] = np.inf
            least = size.argmin(axis=1)
            drop = (size[responses, least] < t_stop) & (self.members[model].sum(axis=1) > 1)
            code = code - drop * weights[least]
        return np.asarray(place[code])


def subset_fits(columns: FloatArray, observed: FloatArray) -> ManyFits:
    """Fit every subset of the terms to every response.

    Args:
        columns: (n, k), or (r, n, k) where each response has its own.
        observed: responses (r, n), n > k.
    """
    n, k = columns.shape[-2:]
    X = columns.reshape(-1, n, k)
    scale = np.linalg.norm(X, axis=1)
    members = (np.arange(1, 2**k)[:, None] >> np.arange(k) & 1).astype(bool)
    shape = (len(members), len(observed), k)
    coefficients, t_ratios, sse = np.zeros(shape), np.zeros(shape), np.empty(shape[:2])
    for m, inside in enumerate(members):
        Q, R = np.linalg.qr(X[:, :, inside] / scale[:, None, inside])
        inverse = np.linalg.inv(R)
        along = np.matmul(observed[:, None, :], Q)[:, 0]
        sse[m] = np.sum((observed - np.matmul(Q, along[:, :, None])[:, :, 0]) ** 2, axis=1)
        scaled = np.matmul(inverse, along[:, :, None])[:, :, 0]
        error = np.linalg.norm(inverse, axis=-1) * np.sqrt(sse[m] / (n - inside.sum()))[:, None]
        coefficients[m][:, inside] = scaled / scale[:, inside]
        t_ratios[m][:, inside] = scaled / error
    return ManyFits(members, coefficients, t_ratios, sse, n)


def fits_in_blocks(columns: FloatArray, observed: FloatArray) -> Iterator[ManyFits]:
    """The same for ``BLOCK`` responses at a time."""
    for start in range(0, len(observed), BLOCK):
        rows = slice(start, start + BLOCK)
        yield subset_fits(columns if columns.ndim == 2 else columns[rows], observed[rows])


#: Five terms of Eq. 5.3.2 by their place in the nine of Eq. 5.3.6; the first two are the true ones.
POSITIONS = {"five terms (5.3.2)": (0, 3, 2, 1, 4), "nine terms (5.3.6)": (0, 3, 2, 1, 4, 5, 6, 7, 8)}
TRUE_TERMS = 2
#: Relative standard deviation of the noise of E, per cent: from the rounding of the print to Config. I's own scatter.
NOISE = (0.01, 0.1, 0.3, 1.0, 3.0, 10.0)
FARTHER = 2.0  #: amplitude, over the largest of the data, at which what was selected is extrapolated
#: Ways of selection, and the colour, mark and line of each.
METHODS: dict[str, tuple[str, str, Any]] = {
    "backward elimination, |T| >= 2": (LINEAR, "o", "-"),
    "best subset, BIC": (AVERAGE, "s", (0, (4, 2))),
    "best subset, BIC, coefficients > 0": ("#009e73", "D", "-"),
}


@dataclass(frozen=True)
class FalseTerms:
    """What selection does to data of a known law."""

    #: for each set of terms, method and noise ``share_false`` (at least one false term), ``share_exact`` (the true law
    #: and no more), ``share_missing`` (a true term is not there), ``mean_terms``, ``share_negative`` (some coefficient
    #: below 0), ``energy_error_percent`` (root mean square, at twice the largest amplitude), ``monte_carlo_error``
    #: (standard, of a share of one half)
    selection: pd.DataFrame
    frequency: pd.DataFrame  #: share of the runs in which each term is selected
    #: standard deviation of the coefficient of A^2 omega, per cent, for noise of 1 per cent of the mean energy, with
    #: the true terms, five and nine (closed form), and over that with the true terms
    inflation: pd.DataFrame
    replicates: int


def false_terms(noise: Sequence[float] = NOISE, replicates: int = 1000, seed: int = 0) -> FalseTerms:
    """Simulate selection, ``replicates`` runs at each ``noise``, per cent."""
    A, omega, true = known_law()
    selection, frequency = [], []
    for number, (name, percent) in enumerate(product(POSITIONS, noise)):
        rng = np.random.default_rng([seed, number])
        observed = true * (1.0 + 0.01 * percent * rng.standard_normal((replicates, len(true))))
        X, farther = design(A, omega, name), design(FARTHER * A.max(), omega[A.argmax()], name)[0]
        for method, (members, coefficients) in _select(X, observed).items():
            head = {"terms": name, "method": method, "noise_percent": percent}
            selection.append({**head, **_measure_selection(members, coefficients, farther)})
            for k, (place, share) in enumerate(zip(POSITIONS[name], members.mean(axis=0).tolist(), strict=True)):
                frequency.append({**head, "term": NINE_TERMS[place], "true": k < TRUE_TERMS, "share": share})
    table = pd.DataFrame(selection).assign(monte_carlo_error=0.5 / np.sqrt(replicates))
    return FalseTerms(table, pd.DataFrame(frequency), _tabulate_inflation(A, omega, true), replicates)


def known_law() -> tuple[FloatArray, FloatArray, FloatArray]:
    """A and omega of the corrected Table 5.II and the energy of the law that made it, without noise."""
    A, omega = columns(load_table("5_II", "corrected"), "A_in", "omega_rad_s")
    return A, omega, GENERATOR["A2w"] * A**2 * omega + GENERATOR["A3w"] * A**3 * omega


def design(A: FloatArray | float, omega: FloatArray | float, terms: str) -> FloatArray:
    """Columns (n, k) of the five or nine terms, the true ones first."""
    A, omega = np.atleast_1d(A), np.atleast_1d(omega)
    return energy_design(NINE_TERMS, A, omega, np.ones_like(A)).columns[:, POSITIONS[terms]]


def _select(X: FloatArray, observed: FloatArray) -> dict[str, tuple[np.ndarray, FloatArray]]:
    """Members (r, k) and coefficients (r, k) that each method selects; all False where it selects nothing."""
    chosen: dict[str, list[tuple[np.ndarray, FloatArray]]] = {method: [] for method in METHODS}
    for fits in fits_in_blocks(X, observed):
        models = (fits.backward(2.0), fits.best(), fits.best(nonnegative=True))
        for method, model in zip(METHODS, models, strict=True):
            members = fits.members[model] & (model >= 0)[:, None]
            coefficients = np.where(members, fits.coefficients[model, np.arange(len(model))], 0.0)
            chosen[method].append((members, coefficients))
    parts = {method: list(zip(*blocks, strict=True)) for method, blocks in chosen.items()}
    return {method: (np.concatenate(members), np.concatenate(values)) for method, (members, values) in parts.items()}


def _measure_selection(members: np.ndarray, coefficients: FloatArray, farther: FloatArray) -> dict[str, float]:
    false, true = members[:, TRUE_TERMS:].any(axis=1), members[:, :TRUE_TERMS].all(axis=1)
    energy = float(farther[:TRUE_TERMS] @ list(GENERATOR.values()))
    errors = coefficients @ farther / energy - 1.0
    return {
        "share_false": float(false.mean()),
        "share_exact": float((true & ~false).mean()),
        "share_missing": float((~true).mean()),
        "mean_terms": float(members.sum(axis=1).mean()),
        "share_negative": float((coefficients < 0.0).any(axis=1).mean()),
        "energy_error_percent": 100.0 * float(np.sqrt(np.mean(errors**2))),
    }


def _tabulate_inflation(A: FloatArray, omega: FloatArray, true: FloatArray) -> pd.DataFrame:
    """sqrt of the first diagonal element of (X^T X)^-1, times noise, over the true coefficient."""
    X = design(A, omega, "nine terms (5.3.6)")
    sigma = 0.01 * float(true.mean())
    rows = []
    for name, k in (("true terms", TRUE_TERMS), ("five terms (5.3.2)", 5), ("nine terms (5.3.6)", 9)):
        scale = np.linalg.norm(X[:, :k], axis=0)
        inverse = np.linalg.inv(np.linalg.qr(X[:, :k] / scale)[1])
        sd = sigma * float(np.linalg.norm(inverse[0])) / float(scale[0])
        rows.append({"terms": name, "sd_percent": 100.0 * sd / GENERATOR["A2w"]})
    table = pd.DataFrame(rows)
    return table.assign(over_true_terms=table["sd_percent"] / table["sd_percent"].iloc[0])


@styled
def draw_false_terms(selection: pd.DataFrame) -> Figure:
    """Draw how often a term is selected that is not there, and the energy error at twice the amplitude, against noise.

    ``selection`` is that of :class:`FalseTerms`.
    """
    figure, panels = build_panels(5.6, 2, len(POSITIONS), sharex=True, sharey="row")
    for (share, error), terms in zip(panels.T, POSITIONS, strict=True):
        for method, (colour, marker, line) in METHODS.items():
            rows = selection[(selection["terms"] == terms) & (selection["method"] == method)]
            style = {"color": colour, "marker": marker, "linestyle": line, "markersize": 4}
            share.plot(rows["noise_percent"], rows["share_false"], label=method.replace(">=", "≥"), **style)
            error.plot(rows["noise_percent"], rows["energy_error_percent"], **style)
        share.set(title=f"chosen among\n{terms}", xscale="log", ylim=(0.0, 1.0))
        error.set(yscale="log")
        plain_log(error.xaxis)
        plain_log(error.yaxis)
        error.set_xlabel("noise of the energy (per cent)")
    panels[0, 0].set_ylabel("share of runs\nwith a false term")
    panels[1, 0].set_ylabel("energy error\nat 2 A (per cent)")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=1, fontsize=7.5)
    return figure
