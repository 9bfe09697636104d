"""Ranking and diagnosis report in their first line an explanation of one that leaves the band of the other."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import damping as dp
from damping import agreement, extrapolation
from damping.agreement import describe_disagreement, describe_fall, describe_misfit, simulate_resonance
from damping.gap import diagnose, problem
from damping.gap.corrected import corrected_mode
from damping.infer.discrepancy import JointEvidence
from damping.infer.observations import observe
from damping.ranking.verdict import FitVerdict
from damping.records.resonance import find_resonance
from damping.records.text import AGREED, Disagreement, describe_p
from damping.report.gap_page import render_gap_page
from damping.report.page import Footer
from damping_reed1970 import data_folder
from tests.gap.limited import limited


@pytest.fixture(scope="module")
def flagship() -> tuple[dp.Record, dp.Mode]:
    """Configuration II, first mode: three peaks, and a simulation whose damping is their mean (Tables 4.I, 4.II)."""
    folder = data_folder() / "saturn-v"
    return dp.read_record(folder / "records" / "config-2-mode-1.csv"), dp.read_mode(
        folder / "modes" / "config-2-mode-1.toml"
    )


@pytest.fixture(scope="module", autouse=True)
def made_once():
    """Laws are weighed and a gap is explained once a record, not for either side of a comparison; a tenth of draws."""
    plan, explain, made = extrapolation.plan_loads, agreement.explain, {}

    def plan_once(data, laws, seed, done, mode, estimate, ranking):
        assert ranking is None
        key = (data.A.tobytes(), data.D.tobytes(), tuple(laws), seed, mode.mass, mode.tolerance, estimate)
        if key not in made:
            made[key] = plan(data, laws, seed, done, mode, estimate)
        return made[key]

    def explain_once(record, mode, *others, brief=False, done=None):
        assert not any(others)
        key = (record.table.to_csv(), repr(mode), brief, *diagnose.CATALOGUE)
        if key not in made:
            made[key] = explain(record, mode, brief=brief)
        return made[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(extrapolation, "plan_loads", plan_once)
        patch.setattr(agreement, "explain", explain_once)
        patch.setattr(diagnose, "explain", explain_once)
        patch.setattr("damping.extrapolation.draws.AVERAGE_DRAWS", 4_000)
        patch.setattr("damping.extrapolation.FRESH_DRAWS", 154)
        yield


@pytest.fixture(scope="module")
def diagnosed(flagship):
    return limited(["slip", "velocity-squared"], dp.diagnose, *flagship, compare=False)


@pytest.fixture(scope="module")
def disagreeing(flagship):
    """The flagship, and its loads at 90 and 60 lb: slip, with one chance in ten, leaves their band; 90 lb is named."""
    return *flagship, dp.extrapolate(*flagship, [90.0, 60.0])


def test_only_slip_leaves_the_band_of_the_flagship(flagship, disagreeing):
    """Force over a power of amplitude in the place of the simulated viscous one: the ranked laws and effects agree."""
    explained, band = agreement.explain(*flagship), disagreeing[-1].loads.average
    kept = [own.hypothesis for own in explained.hypotheses if own.probability > agreement.KEPT]
    assert len(kept) > 2
    for own in kept:
        omega = own.best.model.problem.rows.omega
        (amplitude,) = simulate_resonance(corrected_mode(own.best), np.array([90.0]), omega)
        assert (band.low[0] < amplitude < band.high[0]) == (own.effects != ("slip",))


def test_both_say_where_they_disagree(disagreeing):
    loads = disagreeing[-1]
    (said,) = loads.against
    assert said.startswith("ranking and diagnosis disagree at the force 90 lb")
    assert "corrected by slip, which the diagnosis does not exclude" in said
    assert "velocity-squared, which leads" in said
    assert "stays within the band" in said
    prediction = loads.to_json()["predictions"][0]
    median, low, high = (
        f"{prediction[end]:.3g}" for end in ("median", "low", "high")
    )  # no more than bands are known to
    assert f": the ranked laws predict {median} in ({low} to {high}), the simulation" in said
    assert loads.to_json()["cautions"][0] == said
    assert loads.headlines[0] == said


@pytest.mark.parametrize(
    ("said", "first"),
    [
        ("ranking and diagnosis disagree at the force 1: the ranked laws predict 2, the simulation 3", True),
        ("ranking and diagnosis disagree on whether the rows are explained", False),
        ("neither ranking nor diagnosis explains the rows", False),
    ],
)
def test_a_diagnosis_says_where_it_disagrees(diagnosed, said, first, no_drawing):
    """Of a load in its first sentence, else behind what is found; always in the first caution of the form."""
    against = Disagreement(on_loads=(said,)) if first else Disagreement(on_rows=(said,))
    diagnosis = replace(diagnosed, against=against)
    assert diagnosis.to_json()["cautions"][0] == said
    capital = f"{said[0].upper()}{said[1:]}."
    assert (diagnosis.sentences[0] == capital) == first
    assert first or diagnosis.sentences[0].startswith("The ")
    assert [sentence for sentence in diagnosis.sentences if sentence.endswith(f"{said[1:]}.")] == [
        capital if first else f"Caution: {said}."
    ]
    page = render_gap_page(diagnosis.diagnosis, None, diagnosis.against, Footer(1, {}, {}))
    assert page.count(said[1:]) == 1
    assert (page.index(said[1:]) < page.index('class="lead"')) == first


def test_what_is_said_of_the_rows_alone_follows_the_loads(flagship, few_laws):
    """On the terminal it stands among the cautions, in the form it is the first of them."""
    loads = replace(dp.extrapolate(*flagship, [90.0]), against=AGREED)
    poor = replace(loads, against=Disagreement(on_rows=("ranking and diagnosis disagree on the rows",)))
    assert poor.headlines == loads.headlines
    assert poor.cautions == (*poor.against, *loads.cautions)
    of_load = replace(loads, against=Disagreement(on_loads=("ranking and diagnosis disagree at the force 90",)))
    assert of_load.headlines == (*of_load.against, *loads.headlines)
    assert of_load.cautions == (*of_load.against, *loads.cautions)


def test_the_resonance_of_a_simulation_is_that_of_its_damping(flagship, few_laws):
    """A = F/(c omega_n) of viscous damping (Eq. 4.1.7)."""
    record, mode = flagship
    loads, data = dp.extrapolate(record, mode, [30.0, 90.0]).loads, observe(record)
    expected = loads.force / (1.643 * 2.0 * np.pi * mode.frequency)
    np.testing.assert_allclose(simulate_resonance(mode, loads.force, data.omega), expected, rtol=1e-9)


@pytest.fixture(scope="module")
def two_planes() -> tuple[dp.Record, dp.Mode]:
    """A linear structure driven at 28 degrees to two planes at 20 and 20.3 Hz, simulated as one; 1 % of noise."""
    mass, omega, zeta = 2.0, 2.0 * np.pi * 20.0, 0.008
    frequency = np.tile(np.linspace(19.4, 20.9, 25), 3)
    force, noise = np.repeat([1.0, 2.0, 4.0], 25), 0.01 * np.random.default_rng(21).standard_normal((2, 75))
    phasor = force * receive_in_two_planes(2.0 * np.pi * frequency)
    frame = pd.DataFrame(
        {
            "sweep": np.repeat(["A", "B", "C"], 25),
            "force": force,
            "frequency": frequency,
            "amplitude": np.abs(phasor) * (1.0 + noise[0]),
            "phase": -np.angle(phasor) + noise[1],
        }
    )
    mode = dp.Mode(name="one plane", frequency=20.0, mass=mass, damping=viscous(2.0 * zeta * mass * omega))
    return dp.Record(frame), mode


def viscous(coefficient: float) -> dict[str, dict[str, float]]:
    """The damping table of a mode."""
    return {"viscous": {"coefficient": coefficient}}


def receive_in_two_planes(omega: np.ndarray) -> np.ndarray:
    """Receptance of the truth: each plane's own times the squared cosine or sine of the angle (report, 3.1.24)."""
    parts = [(np.cos(np.radians(28.0)) ** 2, 20.0), (np.sin(np.radians(28.0)) ** 2, 20.3)]
    natural = [(share, 2.0 * np.pi * hertz) for share, hertz in parts]
    return sum(share / (2.0 * (w**2 - omega**2 + 2j * 0.008 * w * omega)) for share, w in natural)


def test_a_second_plane_is_part_of_the_corrected_model(two_planes, few_laws):
    """What the test of the truth reads, in proportion; without the second plane it was 20 % too large."""
    omega = 2.0 * np.pi * np.linspace(19.4, 20.9, 25)
    phasor = receive_in_two_planes(omega)
    columns = {"force": 1.0, "frequency": omega / (2.0 * np.pi), "amplitude": np.abs(phasor)}
    expected = 8.0 * find_resonance("A", pd.DataFrame({**columns, "phase": -np.angle(phasor)})).amplitude
    plane = {"angle": np.radians(28.0), "frequency_ratio": 20.3 / 20.0, "damping_ratio": 20.3 / 20.0}
    mode = replace(two_planes[1], effects={"planar-coupling": plane})
    (amplitude,) = simulate_resonance(mode, np.array([8.0]), omega)
    # the damping of the second plane is its own by a factor on the first's, which differs by 1.5 % in frequency
    assert amplitude == pytest.approx(expected, rel=2e-3)
    assert amplitude == pytest.approx(8.0 * np.abs(phasor).max(), rel=0.03)  # read at pi/2, just below the largest
    gain = {"amplitude-scale": {"factor": 2.0}}  # of the rig: what is read, not what moves
    (read,) = simulate_resonance(replace(mode, effects=mode.effects | gain), np.array([8.0]), omega)
    assert read == amplitude


@pytest.mark.parametrize("tried", ["few_laws", pytest.param("few_draws", marks=pytest.mark.slow)])
def test_no_conflict_over_two_planes_but_no_law_fits(two_planes, tried, request):
    """Forces of one plane miss the rows of the sweeps, not the resonances: the answer begins with that."""
    request.getfixturevalue(tried)
    loads = dp.extrapolate(*two_planes, [8.0])
    assert loads.against == AGREED
    assert loads.to_json()["cautions"][0].startswith("no law fits")
    assert loads.to_json()["predictions"][0]["cautions"][0].startswith("no law fits")
    assert describe_p(dp.rank(two_planes[0]).ranking.fit.p_value) in loads.headlines[0]


def test_a_curve_says_where_the_diagnosis_disagrees(disagreeing):
    """As loads do, in the first caution, with both numbers."""
    record, mode, loads = disagreeing
    traced = dp.curve(record, mode, forces=[90.0])
    (said,) = loads.against
    assert traced.to_json()["cautions"][0] == said


def test_loads_for_amplitudes_are_compared_as_amplitudes(flagship):
    """The forces that reach an amplitude are no amplitudes: compared with those of the model they say nothing."""
    record, mode = flagship
    assert dp.extrapolate(record, mode, amplitudes=[2.0]).against == AGREED


def test_a_record_too_long_for_a_diagnosis_says_so(flagship, few_laws, monkeypatch):
    """A diagnosis refuses more than so many rows: the loads of such a record are not compared, and this is said."""
    record, mode = flagship
    for module in (agreement, problem):
        monkeypatch.setattr(module, "MOST_ROWS", len(record) - 1)
    monkeypatch.setattr(agreement, "explain", lambda record, mode, **_: problem.refuse_rows([(record, mode)]))
    said = dp.extrapolate(record, mode, [90.0]).against
    assert said == Disagreement(on_rows=("not compared with a diagnosis, which is of at most 2 rows",))


def test_an_offset_that_the_audit_finds_is_taken_off_before_laws_are_fitted(few_laws):
    """Viscous damping c read 0.25 rad late: ranked with the offset no law fits. Every command says so."""
    c, omega_n = 4.0, 2.0 * np.pi * 20.0
    frequency, force = np.tile(np.linspace(19.4, 20.6, 15), 2), np.repeat([1.0, 2.0], 15)
    omega, noise = 2.0 * np.pi * frequency, 0.005 * np.random.default_rng(5).standard_normal((2, 30))
    Z = 2.0 * (omega_n**2 - omega**2) + 1j * c * omega
    frame = pd.DataFrame({"sweep": np.repeat(["A", "B"], 15), "force": force, "frequency": frequency})
    frame = frame.assign(amplitude=force / np.abs(Z) * np.exp(noise[0]), phase=np.angle(Z) + noise[1])
    read, mode = dp.Record(frame.assign(phase=frame["phase"] + 0.25)), dp.Mode(name="mode", frequency=20.0, mass=2.0)
    late = dp.rank(read)
    assert late.ranking.fit.verdict == "fits"
    for answer in (late, dp.extrapolate(read, mode, [2.5]), dp.curve(read, mode, forces=[2.5])):
        assert any("0.25 rad" in caution and "was removed" in caution for caution in answer.to_json()["cautions"])
    as_it_is = dp.rank(dp.Record(frame))
    assert not any("was removed" in caution for caution in as_it_is.cautions)
    assert late["viscous"].candidate.coefficients[0].value == pytest.approx(c, rel=0.01)  # some standard errors


@pytest.mark.parametrize("tried", ["few_laws", pytest.param("few_draws", marks=pytest.mark.slow)])
def test_what_neither_explains_is_said_by_both(tried, request):
    """Three peaks that no law explains, nor any effects: none of them is an outlier, so that the others fit."""
    request.getfixturevalue(tried)
    frame = pd.DataFrame({"sweep": list("ABC"), "force": [1.0, 2.0, 4.0], "frequency": [20.0, 20.01, 19.99]})
    record = dp.Record(frame.assign(amplitude=[0.0016, 0.0019, 0.0085]))
    mode = dp.Mode(name="mode", frequency=20.0, mass=2.0, damping=viscous(5.0))
    ranking, diagnosis = dp.rank(record, mode), dp.diagnose(record, mode)
    assert ranking.ranking.fit.verdict == "none fits"
    assert ranking.to_json()["cautions"][0].startswith("neither ranking nor diagnosis explains the rows")
    form = diagnosis.to_json()
    assert form["unexplained"]
    assert form["in_library"] < 0.1  # p = 3e-8 of what is left
    assert form["cautions"][0] == ranking.cautions[0]


@pytest.mark.parametrize(
    ("verdict", "effects", "unexplained", "said"),
    [
        ("none fits", (), False, "adds no effect and treats the rest as noise"),
        ("none fits", ("slip",), False, None),
        ("fits", ("slip",), True, "finds more than noise left beside slip"),
        ("fits", (), False, None),
    ],
)
def test_verdicts_that_differ_are_said(verdict, effects, unexplained, said):
    mode = SimpleNamespace(effects={})
    explained = SimpleNamespace(leading=SimpleNamespace(effects=effects), unexplained=unexplained, mode=mode)
    sentences = describe_misfit(FitVerdict(verdict, 0.005, 6.6), explained)
    assert sentences == () if said is None else said in sentences[0]
    mode.effects = {"planar-coupling": {}}  # which no law has: that none fits is no conflict
    assert verdict == "fits" or effects or not describe_misfit(FitVerdict(verdict, 0.005, 6.6), explained)


@pytest.mark.parametrize(("resonances", "few"), [(4, ", so few that they have little power"), (9, "")])
def test_a_law_that_fits_resonances_alone_is_said_to(resonances, few):
    """Fewer than 6 points are no test of a law of several coefficients."""
    explained = SimpleNamespace(leading=SimpleNamespace(effects=("slip",)), unexplained=True, mode=None)
    (said,) = describe_misfit(FitVerdict("fits", 0.97, 1.0), explained, resonances)
    assert f"a law fits their {resonances} resonances alone{few} (p = 0.97), while the diagnosis finds" in said
    assert said.endswith("more than noise left in all rows beside slip")


@pytest.mark.parametrize(
    ("joint", "effects", "at_resonance", "said"),
    [
        (JointEvidence(0.84, 1.0, informative=True), ("stiffness-softening",), False, True),
        (JointEvidence(0.84, 1.0, informative=True), ("slip", "drift"), False, False),
        (JointEvidence(0.84, 1.0, informative=True), ("stiffness-softening",), True, False),
        (JointEvidence(0.30, 0.0, informative=True), ("stiffness-softening",), False, False),
        (JointEvidence(informative=False), ("stiffness-softening",), False, False),
        (JointEvidence(0.84, 1.0, informative=True), (), False, False),
    ],
)
def test_another_cause_of_a_resonance_that_falls_is_said(joint, effects, at_resonance, said):
    leading = SimpleNamespace(effects=effects, probability=0.9)
    rows = SimpleNamespace(at_resonance=at_resonance)
    setting = SimpleNamespace(problem=SimpleNamespace(rows=rows))
    explained = SimpleNamespace(leading=leading, hypotheses=(leading,), setting=setting, unexplained=False)
    sentences = describe_fall(joint, explained)
    assert bool(sentences) == said
    assert not said or "probability 0.84), while the diagnosis finds stiffness-softening (0.90)" in sentences[0]
    assert not said or "rely on the diagnosis, which leaves only noise" in sentences[0]
    explained.unexplained = True
    assert not said or "rely on neither" in describe_fall(joint, explained)[0]


def test_a_cause_that_is_hardly_in_the_library_is_quoted_no_amplitude_of(flagship):
    """Slip leaves the band of the flagship at 90 lb; were the cause in no library as likely as not, it had no say."""
    record, mode = flagship
    explained = agreement.explain(record, mode)
    loads = dp.extrapolate(record, mode, [90.0]).loads
    assert describe_disagreement(loads, explained)
    assert not describe_disagreement(loads, replace(explained, in_library=0.49))
