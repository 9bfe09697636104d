"""Results as tables, and the JSON forms made from these tables: ``rank/1``, ``loads/1``, ``gap/1``.

JSON, terminal, pages and data sets all take their numbers from here. A number that does not exist is NaN in a table.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from damping.arrays import RAD_S_PER_HZ
from damping.extrapolation.curve import Curve
from damping.extrapolation.plan import Plan
from damping.extrapolation.prediction import PARTS, Loads
from damping.infer.observations import Observations
from damping.ranking import Candidate, Ranking
from damping.records.mode import Mode

if TYPE_CHECKING:
    from damping.gap.corrected import EffectPosterior
    from damping.gap.diagnose import Diagnosis
    from damping.gap.next_test import NextTest

Form = dict[str, Any]

#: Factor between the frequency of a mode and the tested ones from which on a mistake of units is likely (2 pi is one).
FAR = 1.5


def list_mode_cautions(data: Observations, mode: Mode) -> list[str]:
    """Cautions on the mode: a frequency far from every tested one."""
    low, high = (float(omega) / RAD_S_PER_HZ for omega in (data.omega.min(), data.omega.max()))
    if low / FAR <= mode.frequency <= high * FAR:
        return []
    tested = f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"
    return [f"the mode's frequency, {mode.frequency:.4g} Hz, is far from those of the record, {tested} Hz"]


def tabulate_tested(data: Observations) -> pd.DataFrame:
    """One row for each sweep, at its resonance: ``sweep, points, force, frequency`` (Hz)``, amplitude``."""
    return pd.DataFrame(
        {
            "sweep": data.sweeps,
            "points": data.rows_per_sweep,
            "force": data.tested_force,
            "frequency": data.tested_omega / RAD_S_PER_HZ,
            "amplitude": data.tested_amplitude,
        }
    )


def tabulate_candidates(ranking: Ranking) -> pd.DataFrame:
    """One row for each candidate, best first: criteria, errors in per cent of resonant amplitude, cautions."""
    table = pd.DataFrame(
        {
            "rank": candidate.rank,
            "law": candidate.name,
            "weight": candidate.weight,
            "score": candidate.score,
            "score_standard_error": 2.0 * candidate.evidence.standard_error if candidate.evidence else np.nan,
            "held_out_error": candidate.held_out_error,
            "average_absolute_percent": candidate.average_absolute_percent,
            "physical": candidate.physical,
            "equivalents": "; ".join(candidate.equivalents),
            "cautions": "; ".join(candidate.cautions),
        }
        for candidate in ranking.candidates
    )
    return table.astype({"rank": "Int64"})


#: Keys of a model of ``rank/1`` that are columns of the table, in the order of the form.
_RANK_KEYS = ("score", "weight", "held_out_error", "average_absolute_percent", "physical")


def rank_form(ranking: Ranking) -> Form:
    """The form ``rank/1``; shape parameters and further criteria are extra keys."""
    rows = tabulate_candidates(ranking).to_dict("records")
    return {
        "format": "rank/1",
        "criterion": ranking.criterion,
        "fit": {"verdict": ranking.fit.verdict, "p_value": ranking.fit.p_value},
        "models": [
            {
                "rank": candidate.rank,
                "name": candidate.name,
                "forces": _build_forces(candidate),
                **{key: row[key] for key in _RANK_KEYS},
                "cautions": list(candidate.cautions),
                "equivalents": list(candidate.equivalents),
            }
            for row, candidate in zip(rows, ranking.candidates, strict=True)
        ],
    }


def _build_forces(candidate: Candidate) -> list[Form]:
    """One entry for each force; its shape parameters are nested by name."""
    entries: list[Form] = []
    for c in candidate.coefficients:
        numbers = {"std_error": c.std_error, "t_ratio": c.t_ratio, "low": c.low, "high": c.high}
        if c.shape:
            owner = next(entry for entry in entries if entry["name"] == c.force)
            owner[c.shape] = {"value": c.value, **numbers}
        else:
            entries.append({"name": c.force, "coefficient": c.value, **numbers})
    nothing = dict.fromkeys(("std_error", "t_ratio", "low", "high"))
    return entries or [{"name": name, "coefficient": None, **nothing} for name in candidate.law.components]


#: Keys of a band: of a prediction of ``loads/1`` before the parts of its spread.
_BAND_KEYS = ("median", "low", "high", "credible_low", "credible_high")
#: Prefix of the columns of the parts of a predictive distribution, standard deviations in per cent of amplitude.
PART = "sd_percent_"
#: What these parts (:data:`PARTS`) are called for people, on pages and on the terminal.
PART_NAMES = {
    "measurement_noise": "noise",
    "parameters": "coefficients",
    "between_model": "which law",
    "discrepancy": "change of the law beyond the test",
}


def tabulate_loads(loads: Loads, curve: Curve | None = None) -> pd.DataFrame:
    """One row for each force (or requested amplitude) with the keys of ``loads/1``: averaged over models.

    The linear prediction is included; with ``curve`` also the frequency and the damping ratio there.
    """
    asked = {"force": loads.force} if loads.amplitude is None else {"amplitude": loads.amplitude}
    damped = [f"{name}{end}" for name in ("frequency", "damping_ratio") for end in ("", "_low", "_high")]
    return pd.DataFrame(
        {
            **asked,
            "extrapolation_ratio": loads.ratio,
            **{key: getattr(loads.average, key) for key in _BAND_KEYS},
            "linear": loads.linear,
            "linear_overprediction_percent": loads.overprediction,
            "linear_overprediction_low": loads.overprediction_low,
            "linear_overprediction_high": loads.overprediction_high,
            **{f"{PART}{part}": loads.parts[part] for part in PARTS},
            **(curve.table[damped] if curve else {}),
            "cautions": ["; ".join(caution) for caution in loads.cautions],
        }
    )


def tabulate_loads_by_model(loads: Loads) -> pd.DataFrame:
    """One row for each law and force."""
    parts = [
        pd.DataFrame(
            {"law": band.name, "weight": band.weight, "force": loads.force}
            | {key: getattr(band, key) for key in _BAND_KEYS}
        )
        for band in loads.by_model
    ]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()


def loads_form(loads: Loads, plan: Plan | None = None, curve: Curve | None = None) -> Form:
    """The form ``loads/1``; credible bands and the parts of the predictive spread (per cent) are extra keys.

    ``plan`` adds the basis of the weights, the local exponents and the limit. ``curve``, with the rows of the loads,
    adds frequency and damping ratio.
    """
    asked = "force" if loads.amplitude is None else "amplitude"
    predictions = [
        {
            asked: row[asked],
            **{key: row[key] for key in _BAND_KEYS},
            "parts_percent": {part: row[f"{PART}{part}"] for part in loads.parts},
            **{key: value for key, value in row.items() if str(key).startswith("linear")},
            "extrapolation_ratio": row["extrapolation_ratio"],
            **(_build_ratio(curve, i) if curve else {}),
            "cautions": list(loads.cautions[i]),
            "by_model": [
                {"name": b.name, "weight": b.weight, "median": b.median[i], "low": b.low[i], "high": b.high[i]}
                for b in loads.by_model
            ],
        }
        for i, row in enumerate(tabulate_loads(loads).to_dict("records"))
    ]
    form: Form = {"format": "loads/1", "level": loads.level, "predictions": predictions}
    if plan is None:
        return form
    rows = zip(plan.trend.force, plan.trend.p, plan.trend.sd, strict=True)
    return {**form, "local_exponents": [{"force": F, "p": p, "sd": sd} for F, p, sd in rows], "limit": plan.limit}


def _build_ratio(curve: Curve, row: int) -> Form:
    """Frequency with its band, and damping ratio, of a row."""
    f = curve.frequency.form(row)
    ends = {"frequency": f["median"], "frequency_low": f["low"], "frequency_high": f["high"]}
    return {**ends, "damping_ratio": curve.damping_ratio.form(row)}


def curve_form(curve: Curve) -> Form:
    """The form ``curve/1``; bands of amplitude, force and frequency, and cautions of a row, are extra keys."""
    table = curve.table
    rows = [
        {
            **{name: row[name] for end in ("", "_low", "_high") for name in (f"amplitude{end}", f"force{end}")},
            **_build_ratio(curve, i),
            "q": curve.q.form(i),
            "tested": bool(row["tested"]),
            "cautions": list(curve.cautions[i]),
        }
        for i, row in enumerate(table.to_dict("records"))
    ]
    return {"format": "curve/1", "level": curve.level, "rows": rows}


def gap_form(diagnosis: Diagnosis, sampled: EffectPosterior | None = None) -> Form:
    """The form ``gap/1``; tests, local estimates, posterior and cautions are extra keys."""
    # a ranking needs no diagnosis to load
    from damping.gap.corrected import describe_effects, effect_intervals, name_places, refitted_values  # noqa: PLC0415 - for a gap alone
    from damping.gap.readings import list_far_readings  # noqa: PLC0415 - for a gap alone

    leading, held = diagnosis.leading, diagnosis.held_out
    parameters = describe_effects(leading.best)[0] | {"simulation": refitted_values(leading.best)}
    free = effect_intervals(leading.best)
    stray = {"set_aside": not leading.best.has_outlier_pattern}
    far = [asdict(reading) | stray for reading in list_far_readings(leading.best)]
    scheme = "one force level: nothing can be held out" if held is None else held.scheme
    names = ("nominal", "before", "after", "shrinkage", "low", "high")
    held_out = {"scheme": scheme} | {name: None if held is None else getattr(held, name) for name in names}
    return {
        "format": "gap/1",
        "effects": list(leading.effects),
        "explanations": [{"effects": list(e.effects), "probability": e.probability} for e in diagnosis.explanations],
        "equivalents": [list(group.effects) for group in diagnosis.groups],
        "equivalent_ways": [[list(way) for way in group.ways] for group in diagnosis.groups],
        "unexplained": diagnosis.unexplained,
        "in_library": diagnosis.in_library,
        "levels": [asdict(level) for level in diagnosis.levels],
        "where": [asdict(cell) for cell in diagnosis.where],
        "footprint": [asdict(cell) for cell in diagnosis.footprint],
        "gap": {**asdict(diagnosis.gap), "held_out": held_out},
        "parameters": parameters,
        "places": name_places(leading),
        "intervals": {
            effect: {name: list(free[effect].get(name, (value, value))) for name, value in values.items()}
            for effect, values in parameters.items()
        },
        "next_test": _describe_test(diagnosis.next_test) if diagnosis.next_test else None,
        "candidate_tests": [_describe_test(test) for test in diagnosis.next_tests],
        "tests": [asdict(test) for test in diagnosis.tests],
        "local": [asdict(estimate) for estimate in diagnosis.local],
        "posterior": None if sampled is None else _posterior(sampled),
        "far_off": far,
        "cautions": list(diagnosis.cautions),
    }


def _describe_test(test: NextTest) -> Form:
    return asdict(test) | {"expected_log_odds": test.reported_log_odds}


def _posterior(sampled: EffectPosterior) -> Form:
    low, median, high = np.quantile(sampled.draws, [0.05, 0.5, 0.95], axis=0)
    return {
        "converged": sampled.chains.converged,
        "log_evidence": sampled.log_evidence,
        "parameters": {
            name: {"low": low[i], "median": median[i], "high": high[i]} for i, name in enumerate(sampled.names)
        },
    }
