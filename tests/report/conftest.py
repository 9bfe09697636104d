"""A small study: three resonances of the report, four candidates, one converged chain and one that fails."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from damping.extrapolation.backbone import find_backbone
from damping.extrapolation.curve import trace_loads
from damping.extrapolation.draws import Member, amplitude_draws
from damping.extrapolation.prediction import predict
from damping.infer.chains import Settings, sample
from damping.infer.checks import inference_data, leave_one_out, predictive_check
from damping.infer.law import Law
from damping.infer.observations import Observations, observe
from damping.ranking import rank_laws
from damping.records.mode import Mode, read_mode
from damping.records.reading import read_record
from damping.records.record import Record
from damping.regression.fit import fit_power_law
from damping.report.page import Section, Table
from damping.report.results import Exhibit, LawPosterior, RecordResult, StudyResult
from damping.report.study import Rendered, render
from damping_reed1970 import data_folder

LAWS = (Law(("viscous", "displacement-velocity")), Law(("velocity-power",)), Law(("viscous",)), Law(("coulomb",)))
FORCES = np.array([45.0, 90.0])
SAMPLED = (Law(("viscous", "displacement-velocity")), Law(("velocity-power",)))


def record_result(name: str, title: str, record: Record, mode: Mode, forces: np.ndarray) -> RecordResult:
    """Rank, sample and predict; the second law gets too few steps and fails."""
    data = observe(record)
    ranking = rank_laws(data, 0, LAWS)
    posteriors = tuple(_sampled(ranking.find(law), data, failing=law is SAMPLED[1]) for law in SAMPLED)
    members = [
        Member(p.law.name, p.weight, p.posterior.coordinates, p.posterior.draws)
        for p in posteriors
        if p.posterior.converged
    ]
    grid = np.linspace(15.0, 95.0, 12)
    several = len(data.sweeps) > 1
    bands = predict(members, grid, data, 0.9, 0)
    design = predict(members, forces, data, 0.9, 0) if len(forces) else None
    backbone = find_backbone(record, mode)
    return RecordResult(
        name=name,
        title=title,
        record=record,
        mode=mode,
        data=data,
        ranking=ranking,
        posteriors=posteriors,
        bands=bands if len(forces) else None,
        design=design,
        curve=trace_loads(bands, backbone, data),
        design_curve=trace_loads(design, backbone, data) if design else None,
        backbone=backbone,
        power_laws=(fit_power_law(data.tested_force, data.tested_amplitude, data.tested_omega),) if several else (),
    )


def _sampled(candidate, data: Observations, failing: bool) -> LawPosterior:
    settings = Settings(budget=20, draws_kept=50) if failing else Settings()
    coordinates = candidate.coordinates
    posterior = sample(coordinates, data, candidate.evidence, lambda x: {}, seed=1, settings=settings)
    assert posterior.converged is not failing
    member = Member(candidate.name, 1.0, coordinates, posterior.draws)
    amplitude = amplitude_draws(member, data.tested_force, data)
    return LawPosterior(
        law=candidate.law,
        weight=candidate.weight,
        posterior=posterior,
        leave_one_out=leave_one_out(inference_data(posterior, data), data),
        check=predictive_check(posterior, data, amplitude, 0.9, 0),
        of_source=True,
    )


@pytest.fixture(scope="session")
def peaks() -> RecordResult:
    """Configuration II, first mode: three resonances, two design forces."""
    folder = data_folder() / "saturn-v"
    record = read_record(folder / "records" / "config-2-mode-1.csv")
    mode = read_mode(folder / "modes" / "config-2-mode-1.toml")
    return record_result("config-2-mode-1", "Configuration II, first mode", record, mode, FORCES)


@pytest.fixture(scope="session")
def sweep() -> RecordResult:
    """Configuration I, second mode: fifteen points of one sweep, no design forces."""
    folder = data_folder() / "saturn-v"
    record = read_record(folder / "records" / "config-1-mode-2-rough.csv")
    mode = read_mode(folder / "modes" / "config-1-mode-2-rough.toml")
    return record_result("rough", "Configuration I, second mode", record, mode, np.empty(0))


@pytest.fixture(scope="session")
def study(peaks: RecordResult, sweep: RecordResult) -> StudyResult:
    """Both records, with a further table."""
    return StudyResult(
        title="A study",
        seed=1970,
        level=0.9,
        records=(peaks, sweep),
        inputs={"config-2-mode-1.csv": "0" * 64},
        versions={"numpy": np.__version__},
        exhibits=(Exhibit([], tables={"further": pd.DataFrame({"a": [1.5, np.nan], "b": ["x", ""]})}),),
    )


@pytest.fixture(scope="session")
def rendered(study: StudyResult) -> Rendered:
    """The page of the study."""
    return render(study)


HOSTILE = "<img src=x onerror=alert(1)>&\"'$x$</script>"


@pytest.fixture(scope="session")
def hostile(study: StudyResult) -> StudyResult:
    """The same study with markup in every text that can come from input."""
    peaks = study.records[0]
    record = Record(peaks.record.table, f"folder/{HOSTILE}.csv")
    units = replace(peaks.mode.units, force=HOSTILE, length=HOSTILE)
    changed = replace(
        peaks,
        title=HOSTILE,
        record=record,
        mode=replace(peaks.mode, name=HOSTILE, units=units),
        data=replace(peaks.data, sweeps=(HOSTILE, "B", "C")),
    )
    table = pd.DataFrame({HOSTILE: [HOSTILE]})
    section = Section("further", HOSTILE, [Table(table, caption=HOSTILE, key=HOSTILE)])
    return replace(
        study,
        title=HOSTILE,
        records=(changed,),
        inputs={HOSTILE: HOSTILE},
        versions={HOSTILE: HOSTILE},
        exhibits=(Exhibit([section], tables={HOSTILE: table}),),
    )


@pytest.fixture(scope="session")
def rendered_hostile(hostile: StudyResult) -> Rendered:
    """The page of the study with markup in its texts."""
    return render(hostile)
