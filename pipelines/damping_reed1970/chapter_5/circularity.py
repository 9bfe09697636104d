"""The circularity of Table 5.IV: laws selected when the truth is known (sections 3.2 and 5.3).

Table 5.IV takes amplitude and energy in the principal pitch plane from one number a point, the linear damping factor
xi that Eq. 3.2.15 gives: E_p = 2 pi M omega_p xi omega A_p^2 holds in every row by construction, and a "law" fitted to
the rows is a description of how xi came out. Here tail motions of structures with a known law are made, with noise,
and sent the same way; and the same selection is asked of data that are not made so: the energy put in,
pi X F sin(phi), against the modal amplitude.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import radians
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from damping.arrays import FloatArray
from damping.forces import make
from damping.plots import build_panels, draw_plain_rows, law_style, styled
from damping.predict.steady import steady_state
from damping.signals import damping_roots, plane_motion
from damping_reed1970 import columns, load_table
from damping_reed1970.chapter_3 import LARGEST_XI, PLANES, PlanarOscillator, pitch_response
from damping_reed1970.chapter_5 import E_4
from damping_reed1970.chapter_5.false_terms import fits_in_blocks

#: Force of each energy term that selection may choose (Table 5.I).
FORCES = ("viscous", "displacement", "velocity-squared", "displacement-velocity", "quadratic-displacement")
#: Points at which the report took the low root of Eq. 3.2.15 (erratum E3IV-1); at the others the high one.
LOW_ROOT = np.isin(np.arange(1, 16), (1, 2, 3, 4, 5, 6, 14, 15))
#: Two planes near those that fit Table 3.III with all five parameters free, by either noise (:mod:`planar_fit`).
FITTED = PlanarOscillator(M=22.8, C=2.49, omega_p=11.399, omega_y=11.491, theta=radians(36.3))
#: The planes that the report's route assumes (Eq. 3.2.16), with its linear coefficient (3.2.19).
ASSUMED = PlanarOscillator(M=PLANES.mass, C=2.30, omega_p=PLANES.omega_p, omega_y=PLANES.omega_y, theta=PLANES.theta)
NOISE = (0.0, 1.0, 3.0, 10.0)  #: relative noise of amplitude and noise of phase (rad), per cent

ROUTES = ("Table 5.IV: A and E from xi", "3.1: modal amplitude, E put in", "rough: tail over factor, E put in")


@dataclass(frozen=True)
class Circularity:
    """The selected laws.

    ``claims`` is of what the report concludes: ``nonlinear_share`` (a force is selected other than viscous and
    displacement, which a narrow band cannot tell apart), ``cubed_share`` (A^3 omega^2 alone fits better than A^2 omega
    alone), ``ratio_share`` (of both together it has the larger T-ratio), ``significant_share`` (that T-ratio is above
    2), median ``C_1``, ``C_3`` of both together (5.3.16), ``no_root_share`` of the points.
    """

    laws: pd.DataFrame  #: best by BIC with coefficients > 0 among all sums of the five forces (measured data: share 1)
    claims: pd.DataFrame
    #: largest relative difference of E_p/(2 pi M omega_p omega A_p^2) from xi over Table 3.IV as printed
    identity: float
    replicates: int


def circularity(noise: Sequence[float] = NOISE, replicates: int = 500, seed: int = 0) -> Circularity:
    """Send simulated tail motions of three known structures through the routes, and the measured data too.

    ``noise``: per cent, of amplitude (relative) and phase (rad); ``replicates`` runs at each.
    """
    laws, claims = [], []
    for name, (A, E) in measured_routes().items():
        law_rows, claim = _judge(A, E)
        laws.append(law_rows.assign(truth="measured", noise_percent=np.nan, route=name))
        claims.append({"truth": "measured", "noise_percent": np.nan, "route": name, **claim})
    for i, (truth, phasor) in enumerate(true_motions().items()):
        for j, percent in enumerate(noise):
            rng = np.random.default_rng([seed, i, j])
            shape = (replicates if percent else 1, phasor.size)
            noise_of = rng.standard_normal(shape) + 1j * rng.standard_normal(shape)
            motion = (phasor - _corrections()) * np.exp(0.01 * percent * noise_of)
            for route, (A, E, solved) in routes(motion).items():
                law_rows, claim = _judge(A, E)
                head = {"truth": truth, "noise_percent": percent, "route": route}
                laws.append(law_rows.assign(**head))  # type: ignore[arg-type]  # a mapping of plain values
                claims.append({**head, **claim, "no_root_share": 1.0 - float(solved.mean())})
    order = ["truth", "noise_percent", "route", "law", "share"]
    return Circularity(pd.concat(laws, ignore_index=True)[order], pd.DataFrame(claims), identity(), replicates)


def identity() -> float:
    """How far the rows of Table 3.IV (corrected rows 6+, 9+ aside) are from E_p = 2 pi M omega_p xi omega A_p^2."""
    table = load_table("3_IV").query("corrected_row == 0")
    omega, xi, A, E = columns(table, "omega_rad_s", "xi", "A2p_in", "energy_pitch_in_lb")
    return float(np.max(np.abs(E / (2.0 * np.pi * PLANES.mass * PLANES.omega_p * omega * A**2) / xi - 1.0)))


def true_motions() -> dict[str, np.ndarray]:
    """Modal motion in the pitch direction, phasors A exp(-i phi) at the 15 test points, of three known structures."""
    F, omega = _test()
    return {
        "linear, planes as assumed": pitch_response(ASSUMED, PLANES.phi * F, omega),
        "linear, planes as fitted": pitch_response(FITTED, PLANES.phi * F, omega),
        "velocity squared, planes as assumed": velocity_squared_motion(E_4.forces["A3w2"]),
    }


def velocity_squared_motion(coefficient: float) -> np.ndarray:
    """Phasors in the pitch direction with the force C3 q'^2 sgn q' in each principal plane by itself."""
    F, omega = _test()
    force = make("velocity-squared", coefficient=coefficient)
    total = np.zeros(omega.size, dtype=complex)
    for omega_j, per_force in PLANES.planes:
        state = steady_state(force, np.abs(per_force) * F, omega, PLANES.mass, omega_j)
        total += np.abs(per_force) / PLANES.phi * state.amplitude * np.exp(-1j * state.phase)
    return total


def routes(tail: np.ndarray) -> dict[str, tuple[FloatArray, FloatArray, np.ndarray]]:
    """A, E (r, points) by each route and where a root was found, from the tail's phasors over the mode factor.

    The energy put in is pi A phi F sin(phase) (Eq. 3.2.9), at least a thousandth of an in-lb where noise makes it
    negative; section 3.1 adds the corrections C_t2 of rigid-body and adjacent-mode motion back.
    """
    E = np.maximum(-np.pi * PLANES.phi * _test()[0] * tail.imag, 1e-3)
    return _take_routes(E, np.abs(tail + _corrections()), np.abs(tail))


def _take_routes(E: FloatArray, modal: FloatArray, tail: FloatArray) -> dict[str, tuple[FloatArray, FloatArray, Any]]:
    """A, E and where a root was found by each route, from the energy put in and both amplitudes."""
    xi, solved = xi_as_the_report(E)
    motion = plane_motion(PLANES, *_test(), xi)
    everywhere = np.ones(E.shape, dtype=bool)
    return {
        ROUTES[0]: (np.asarray(motion.A_p), np.asarray(motion.E_p), solved),
        ROUTES[1]: (modal, E, everywhere),
        ROUTES[2]: (tail, E, everywhere),
    }


def measured_routes() -> dict[str, tuple[FloatArray, FloatArray]]:
    """A and E (1, points) of the measured data: Table 5.IV as printed, and each route without corrections by hand."""
    printed = columns(load_table("5_IV"), "A2p_in", "E_in_lb")
    (E,) = columns(load_table("3_IV").query("corrected_row == 0"), "energy_input_in_lb")
    (A_2,) = columns(load_table("3_III", "corrected"), "modal_amplitude_A2_in")
    (X,) = columns(load_table("3_III"), "tail_amplitude_in")
    taken = {"Table 5.IV as printed": printed} | _take_routes(E[None], A_2[None], X[None] / PLANES.phi)
    return {name: (np.atleast_2d(A), np.atleast_2d(E)) for name, (A, E, *_) in taken.items()}


def xi_as_the_report(E: FloatArray) -> tuple[FloatArray, np.ndarray]:
    """xi of Eq. 3.2.15 for energies (r, 15) and where a root exists: at each point the root that the report took, low
    or high; where there is none the xi of the largest energy, as in the report's rows 10 and 13."""
    roots = _positive_roots(E)
    low, high = np.nanmin(roots, axis=-1, initial=np.inf), np.nanmax(roots, axis=-1, initial=-np.inf)
    xi = np.where(LOW_ROOT, low, high)
    return np.where(np.isfinite(xi), xi, _peaks()), np.isfinite(xi)


def _positive_roots(E: FloatArray) -> FloatArray:
    """Positive roots below ``LARGEST_XI`` of E d1 d2 = n1 d2 + n2 d1, (r, 15, 4), NaN otherwise.

    Plane j loses n_j/d_j = a_j xi/(b_j + c_j xi^2) (Eq. 3.2.13); the roots are eigenvalues of companion matrices.
    """
    F, omega = _test()
    planes = []
    for omega_j, per_force in PLANES.planes:
        r = omega / omega_j
        planes.append(
            (2.0 * np.pi * (per_force * F) ** 2 * omega / (PLANES.mass * omega_j**3), (1.0 - r**2) ** 2, 4.0 * r**2)
        )
    (a1, b1, c1), (a2, b2, c2) = planes
    unit = 0.01  # of xi, so that coefficients are of one size
    terms = (E * b1 * b2, -(a1 * b2 + a2 * b1), E * (b1 * c2 + b2 * c1), -(a1 * c2 + a2 * c1), E * c1 * c2)
    quartic = np.stack([np.broadcast_to(t, E.shape) * unit**n for n, t in enumerate(terms)], axis=-1)
    companion = np.zeros((*E.shape, 4, 4))
    companion[..., 1:, :3] = np.eye(3)
    companion[..., :, 3] = -quartic[..., :4] / quartic[..., 4:]
    z = unit * np.linalg.eigvals(companion)
    real = (np.abs(z.imag) < 1e-6 * np.abs(z)) & (z.real > 0.0) & (z.real < LARGEST_XI)
    return np.where(real, z.real, np.nan)


def _judge(A: FloatArray, E: FloatArray) -> tuple[pd.DataFrame, dict[str, float]]:
    """Shares of the selected laws and of the report's claims over responses (r, points)."""
    _, omega = _test()
    w = np.broadcast_to(omega, A.shape)
    X = np.stack([A**2 * w, A**2, A**3 * w**2, A**3 * w, A**4 * w], axis=-1)
    blocks = list(fits_in_blocks(X, E))
    names = [" + ".join(np.array(FORCES)[members]) for members in blocks[0].members]
    chosen = np.concatenate([block.best(nonnegative=True) for block in blocks])
    shares = pd.Series([names[i] for i in chosen]).value_counts(normalize=True)
    viscous, three, both = (names.index(n) for n in ("viscous", "velocity-squared", "viscous + velocity-squared"))
    ratios = np.concatenate([block.t_ratios[both] for block in blocks])
    medians = np.median(np.concatenate([block.coefficients[both] for block in blocks]), axis=0)
    sse = np.concatenate([block.sse for block in blocks], axis=1)
    nonlinear = blocks[0].members[chosen][:, 2:].any(axis=1)
    claim = {
        "nonlinear_share": float(nonlinear.mean()),
        "cubed_share": float((sse[three] < sse[viscous]).mean()),
        "ratio_share": float((np.abs(ratios[:, 2]) > np.abs(ratios[:, 0])).mean()),
        "significant_share": float((ratios[:, 2] > 2.0).mean()),
        "C_1": float(medians[0] / np.pi),
        "C_3": float(0.375 * medians[2]),
    }
    return pd.DataFrame({"law": shares.index, "share": shares.to_numpy()}), claim


@lru_cache
def _peaks() -> FloatArray:
    """xi of the largest energy loss at each point, whatever the energy."""
    roots = [damping_roots(PLANES, F, omega, 1.0) for F, omega in zip(*_test(), strict=True)]
    return np.array([root.xi_peak for root in roots])


@lru_cache
def _test() -> tuple[FloatArray, FloatArray]:
    """Tail force and omega of the 15 points (Table 3.I)."""
    F, omega = columns(load_table("3_I"), "force_lb", "omega_rad_s")
    return F, omega


@lru_cache
def _corrections() -> FloatArray:
    """C_t2 of Table 3.III: what section 3.1 adds to the tail's motion over the mode factor, in phase with the force."""
    return columns(load_table("3_III", "corrected"), "correction_Ct2_in")[0]


_CLASSES = {
    "linear (viscous or displacement)": "#c3cad1",
    "with velocity squared": law_style("velocity-squared").colour,
    "other nonlinear": law_style("displacement-velocity").colour,
}


@styled
def draw_circularity(laws: pd.DataFrame) -> Figure:
    """Draw which kind of law comes out of known structures: one panel for each route, one bar for each truth and noise.

    ``laws`` are those of :class:`Circularity`.
    """
    kinds = laws.assign(kind=[_describe_kind(law) for law in laws["law"]])
    known = kinds[(kinds["truth"] != "measured") & (kinds["noise_percent"] > 0)]
    cases = list(known[["truth", "noise_percent"]].drop_duplicates().itertuples(index=False, name=None))
    height = 0.9 + (0.6 + 0.2 * len(cases)) * len(ROUTES)
    figure, panels = build_panels(height, len(ROUTES), sharex=True, squeeze=False)
    labels = [f"{truth}, {noise:g} %" for truth, noise in cases]
    for axes, route in zip(panels.flat, ROUTES, strict=True):
        draw_plain_rows(axes, ["measured", *labels])
        _draw_bars(axes, 0, kinds[(kinds["truth"] == "measured") & (kinds["route"] == route)])
        for place, (truth, noise) in enumerate(cases, start=1):
            chosen = (known["truth"] == truth) & (known["noise_percent"] == noise) & (known["route"] == route)
            _draw_bars(axes, place, known[chosen])
        axes.set(xlim=(0.0, 1.0), xticks=[0.0, 0.5, 1.0])
        axes.set_title(route, fontsize=7.5, x=-0.5)
    panels.flat[-1].set_xlabel("share of runs")
    handles = [Patch(color=colour, label=kind) for kind, colour in _CLASSES.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=2, fontsize=7.5)
    return figure


def _draw_bars(axes: Axes, row: int, laws: pd.DataFrame) -> None:
    left = 0.0
    for kind, colour in _CLASSES.items():
        share = float(laws.loc[laws["kind"] == kind, "share"].sum())
        axes.barh(row, share, left=left, color=colour, height=0.72, linewidth=0)
        left += share


def _describe_kind(law: str) -> str:
    """Class of a law: a narrow band cannot tell viscous from displacement-proportional damping."""
    forces = set(law.split(" + "))
    linear, squared, other = _CLASSES
    if forces <= {"viscous", "displacement"}:
        return linear
    return squared if "velocity-squared" in forces else other
