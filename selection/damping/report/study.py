"""A study rendered: the page, every table and every figure, of its records and of the exhibits that join it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from damping.plots.design_loads import ForceAmplitude, force_amplitude
from damping.plots.style import to_svg
from damping.regression.power_law import PowerLaw
from damping.report import tables
from damping.report.answer import answer
from damping.report.figures import Drawn, record_figures
from damping.report.loads import build_loads, build_power_law_section
from damping.report.method import build_cautions, build_method, build_tested
from damping.report.page import Footer, Section, describe_page
from damping.report.record import record_section
from damping.report.results import RecordResult, StudyResult, Svgs, describe_file_stem
from damping.report.tables import record_tables


@dataclass(frozen=True)
class Rendered:
    """``html``: the page. ``tables``, ``figures`` (SVG), ``pages`` (HTML): by the name of their file without ending."""

    html: str
    tables: dict[str, pd.DataFrame]
    figures: dict[str, str]
    pages: dict[str, str]


def render(study: StudyResult) -> Rendered:
    """Render a study; equal studies give equal text."""
    figures, tables = _figures(study), _tables(study)
    further = [section for exhibit in study.exhibits for section in exhibit.sections]
    sections = build_study_sections(study, figures, further)
    for exhibit in study.exhibits:
        figures |= exhibit.figures
        tables |= {name: table for name, table in exhibit.tables.items() if not table.empty}
    footer = Footer(seed=study.seed, versions=study.versions, inputs=study.inputs)
    further_pages = [page for exhibit in study.exhibits for page in exhibit.pages]
    pages = {page.file: describe_page(page.title, page.sections, footer) for page in further_pages}
    return Rendered(describe_page(study.title, sections, footer), tables, figures, pages)


def _figures(study: StudyResult) -> dict[str, str]:
    drawn: dict[str, Drawn] = {}
    for result in study.records:
        drawn |= {describe_file_stem(result, name): one for name, one in record_figures(result, study.level).items()}
    drawn |= {name.replace("_", "-"): one for name, one in study_figures(study).items()}
    return {name: to_svg(one.figure, name, one.title, one.description) for name, one in drawn.items()}


def _tables(study: StudyResult) -> dict[str, pd.DataFrame]:
    tables: dict[str, pd.DataFrame] = {}
    for result in study.records:
        tables |= {describe_file_stem(result, name): table for name, table in record_tables(result).items()}
    return tables


def study_figures(study: StudyResult) -> dict[str, Drawn]:
    """Figures of the whole study by name: log force against log amplitude, where a record has two levels."""
    drawn = _draw_force_amplitude(study)
    return {"force_amplitude": drawn} if drawn else {}


def tabulate_power_line(law: PowerLaw, amplitude: np.ndarray) -> pd.DataFrame:
    """The fitted line over amplitudes with the t interval of the line: ``amplitude, force, low, high``."""
    gradient = np.stack([np.ones_like(amplitude), np.log(amplitude)])
    log_force = law.log_k + law.slope * np.log(amplitude)
    freedom = law.degrees_of_freedom > 0
    half = law.quantile * np.sqrt(np.einsum("in,ij,jn->n", gradient, law.covariance, gradient)) if freedom else np.nan
    columns = {"amplitude": amplitude, "force": log_force, "low": log_force - half, "high": log_force + half}
    return pd.DataFrame({key: value if key == "amplitude" else np.exp(value) for key, value in columns.items()})


def _draw_force_amplitude(study: StudyResult) -> Drawn | None:
    panels, said = [], []
    for result in study.records:
        law = next((law for law in result.power_laws if law.form == "velocity-power"), None)
        if law is None:
            continue
        data, units = result.data, result.mode.units
        points = pd.DataFrame({"sweep": data.sweeps, "force": data.tested_force, "amplitude": data.tested_amplitude})
        reach = (data.tested_amplitude.max() / data.tested_amplitude.min()) ** 0.35
        grid = np.geomspace(data.tested_amplitude.min() / reach, data.tested_amplitude.max() * reach, 60)
        note = _describe_exponent(result, law)
        panels.append(
            ForceAmplitude(result.title, points, tabulate_power_line(law, grid), note, units.force, units.length)
        )
        said.append(f"{result.title}: {' '.join(note.split())}.")
    if not panels:
        return None
    description = "Logarithm of modal force against logarithm of resonant amplitude. " + " ".join(said)
    return Drawn(force_amplitude(panels), "Force against resonant amplitude, logarithmic", description)


def _describe_exponent(result: RecordResult, law: PowerLaw) -> str:
    """The exponent with its t interval, and from the posterior."""
    lines = [f"p = {law.p:.3f}"]
    if law.degrees_of_freedom > 0:
        freedom = f"{law.degrees_of_freedom} degree{'s' * (law.degrees_of_freedom != 1)} of freedom"
        lines = [f"p = {law.p:.3f} ± {law.std_error:.3f} ({freedom})"]
        lines.append(f"{100 * law.level:g} % t interval {law.p_low:.2f} to {law.p_high:.2f}")
    row = tables.tabulate_power_laws(result).set_index("form").loc[law.form]
    if np.isfinite(row["posterior_p"]):
        low, high = row["posterior_p_low"], row["posterior_p_high"]
        lines.append(f"posterior {row['posterior_p']:.2f}, {100 * tables.INTERVAL:g} % {low:.2f} to {high:.2f}")
    return "\n".join(lines)


def build_study_sections(study: StudyResult, svgs: Svgs, further: Sequence[Section] = ()) -> list[Section]:
    """All sections in order, ``further`` ones before the cautions.

    Args:
        svgs: figures by the names that :func:`damping.report.study.render` gives them; missing ones are left out.
    """
    return [
        answer(study, svgs),
        build_tested(study),
        *build_loads(study, svgs),
        *build_power_law_section(study, svgs),
        *(record_section(result, svgs) for result in study.records),
        *further,
        build_cautions(study),
        build_method(study),
    ]
