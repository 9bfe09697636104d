"""The report's tables: corrections applied, identities between columns, records generated from them, errors."""

from __future__ import annotations

import re
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import damping_reed1970 as report_tables
from damping.errors import InputError
from damping.records.mode import read_mode
from damping.records.reading import read_record
from damping_reed1970 import data_folder, load_force_laws, load_table, load_text
from tests.reed1970.saturn_records import RECORD_NAMES, describe_mode_text, record_text, report_record

FOLDER = data_folder() / "saturn-v"
CORRECTIONS = load_text("corrections").to_dict("records")


def cell(table: pd.DataFrame, correction: dict[str, str]) -> float:
    keys = dict(zip(correction["key_columns"].split("|"), correction["key"].split("|"), strict=True))
    found = table
    for column, value in keys.items():
        found = found[found[column].astype(str) == value]
    assert len(found) == 1
    return float(found[correction["column"]].iloc[0])


@pytest.mark.parametrize("name", [p.stem.removeprefix("table_") for p in FOLDER.glob("tables/table_*.csv")])
def test_a_table_loads_in_every_version(name: str) -> None:
    printed, corrected, used = (load_table(name, version) for version in ("printed", "corrected", "used"))
    assert printed.shape == corrected.shape == used.shape
    assert not printed.empty


@pytest.mark.parametrize("correction", CORRECTIONS, ids=lambda c: f"{c['table']}-{c['key']}-{c['column']}")
def test_a_correction_names_one_cell_and_changes_it(correction: dict[str, str]) -> None:
    name, run = correction["table"], correction["run"] or "E4"
    as_printed, corrected, used = (correction[key] for key in ("as_printed", "corrected", "used_by_report"))
    assert cell(load_table(name), correction) == float(as_printed)
    assert cell(load_table(name, "corrected"), correction) == float(corrected or as_printed)
    # the run is text of a table here, one of the literals that the type lists there
    assert cell(load_table(name, "used", run), correction) == float(used or corrected or as_printed)  # type: ignore[arg-type]


def test_the_two_runs_of_table_5_iv_differ_in_one_energy() -> None:
    e3, e4 = load_table("5_IV", "used", "E3"), load_table("5_IV", "used", "E4")
    changed = e3["point"][e3["E_in_lb"] != e4["E_in_lb"]]
    assert list(changed) == [12]
    pd.testing.assert_frame_equal(e3.drop(columns="E_in_lb"), e4.drop(columns="E_in_lb"))


def test_tables_as_used_are_the_recovered_inputs() -> None:
    used, recovered = load_table("5_III", "used"), pd.read_csv(FOLDER / "table_5_III_recovered_inputs.csv")
    assert (
        used[["A2bar_in", "E_in_lb"]].to_numpy().tolist()
        == recovered[["A_recovered", "E_recovered"]].to_numpy().tolist()
    )
    recovered = pd.read_csv(FOLDER / "table_5_IV_recovered_inputs.csv")
    for run in ("E3", "E4"):
        used = load_table("5_IV", "used", run)
        columns = [f"A_recovered_{run}run", f"E_recovered_{run}run"]
        assert used[["A2p_in", "E_in_lb"]].to_numpy().tolist() == recovered[columns].to_numpy().tolist()


def test_errata_of_corrections_and_laws_are_listed() -> None:
    errata = set(load_text("errata")["id"])
    assert len(errata) == len(load_text("errata")) == 75
    assert {c["erratum"] for c in CORRECTIONS} <= errata
    assert set(load_force_laws()["erratum"]) - {""} <= errata
    assert set(load_text("errata")["severity"]) == {"A", "B", "C"}


TABLE_RESULTS = {
    "tab3I.omega": ("3_I", "omega_rad_s"), "tab3I.tip_pitch": ("3_I", "tip_pitch_disp_in"),
    "tab3I.tip_yaw": ("3_I", "tip_yaw_disp_in"), "tab3I.tail_yaw": ("3_I", "tail_yaw_disp_in_e2"),
    "tab3III.Ct2": ("3_III", "correction_Ct2_in"), "tab3III.phi2": ("3_III", "modal_phase_rad"),
    "tab3III.Ccos": ("3_III", "correction_Ct2_cos_phi2_in"), "tab3III.A2": ("3_III", "modal_amplitude_A2_in"),
    "tab3IV.E_input": ("3_IV", "energy_input_in_lb"), "tab3IV.A2p": ("3_IV", "A2p_in"),
    "tab3IV.A2y": ("3_IV", "A2y_in"), "tab3IV.E_pitch": ("3_IV", "energy_pitch_in_lb"),
    "tab3IV.E_yaw": ("3_IV", "energy_yaw_in_lb"), "tab3IV.xi": ("3_IV", "xi"),
    "tab5II.E_eq533": ("5_II", "E_eq533_in_lb"), "tab5II.E_generator": ("5_II", "E_in_lb"),
    "tab5II.dev": ("5_II", "percent_deviation"), "tab5III.A": ("5_III", "A2bar_in"),
    "tab5III.E1": ("5_III", "E1_in_lb"), "tab5III.E2": ("5_III", "E2_in_lb"),
    "tab5III.dev": ("5_III", "percent_deviation_E2"), "tab5III.E_vs_3IV": ("5_III", "E_in_lb"),
    "tab5IV.E3": ("5_IV", "E3_in_lb"), "tab5IV.E4": ("5_IV", "E4_in_lb"),
    "tab5IV.dev": ("5_IV", "percent_deviation_E4"),
}  # fmt: skip


def test_printed_results_are_the_cells_of_the_tables() -> None:
    compared = 0
    for row in load_text("printed_results").to_dict("records"):
        name, key = re.fullmatch(r"([^\[]*)(?:\[(.*)\])?", row["id"]).groups()  # type: ignore[union-attr]  # always matches
        if name in TABLE_RESULTS:
            table, column = TABLE_RESULTS[name]
            frame = load_table(table)
            cells = frame[column][frame[frame.columns[0]].astype(str) == key]
            assert cells.to_list() == [float(row["printed"])], row["id"]
            compared += 1
    assert compared == 355


def test_columns_of_a_table_agree_with_each_other() -> None:
    motion = load_table("3_I", "corrected")
    # omega is printed to 0.005 at best, f to 0.0005 Hz
    np.testing.assert_allclose(motion["omega_rad_s"], 2 * np.pi * motion["frequency_hz"], rtol=0, atol=0.005)
    # tail displacement of Tables 3.I and 3.III is one measurement printed twice
    expected = load_table("3_III")["tail_amplitude_in"]
    np.testing.assert_allclose(motion["tail_pitch_disp_in_e2"] / 100, expected, rtol=1e-12)
    sweeps = load_table("4_I", "corrected")
    # slide rule: F_e = phi_r F to 0.1 per cent
    np.testing.assert_allclose(sweeps["modal_force_lb"], sweeps["phi_r_load_point"] * sweeps["force_lb"], rtol=1e-3)
    rows_v = load_table("4_V", "corrected").set_index("parameter")
    first = load_table("4_I")
    for sweep in "ABC":
        row = first[(first["mode"] == 1) & (first["sweep"] == sweep)].iloc[0]
        # Table 4.V repeats Table 4.I cut to four or five digits
        assert rows_v[f"sweep_{sweep}"]["M_lb_s2_per_in"] == pytest.approx(
            row["generalized_mass_lb_s2_per_in"], rel=2e-4
        )
        assert rows_v[f"sweep_{sweep}"]["Fe_lb"] == row["modal_force_lb"]


def test_force_laws_are_section_6_1() -> None:
    laws = load_force_laws()
    assert len(laws) == 19
    assert laws.groupby(["configuration", "mode"])["equation"].nunique().to_dict() == {
        ("I", 2): 5,
        ("II", 1): 5,
        ("II", 2): 4,
    }
    # every coefficient and exponent stands in the text as printed
    for row in laws.to_dict("records"):
        digits = [float(number) for number in re.findall(r"\d*\.\d+", row["text_as_printed"])]
        assert row["coefficient"] in digits
        assert np.isnan(row["exponent"]) or row["exponent"] in digits


@pytest.mark.parametrize("name", RECORD_NAMES)
def test_committed_records_and_modes_are_generated(name: str) -> None:
    assert (FOLDER / "records" / f"{name}.csv").read_text(encoding="utf-8") == record_text(name)
    assert (FOLDER / "modes" / f"{name}.toml").read_text(encoding="utf-8") == describe_mode_text(name)


@pytest.mark.parametrize("name", RECORD_NAMES)
def test_committed_files_are_read(name: str) -> None:
    record = read_record(FOLDER / "records" / f"{name}.csv")
    assert list(record.table["amplitude"]) == pytest.approx(
        list(report_record(name)["amplitude"]), rel=1e-9
    )  # ten digits
    mode = read_mode(FOLDER / "modes" / f"{name}.toml")
    assert list(mode.damping) == ["viscous"]


def test_the_rough_record_conserves_energy() -> None:
    record = report_record("config-1-mode-2-rough")
    work = np.pi * record["force"] * record["amplitude"] * np.sin(record["phase"])
    # the report took the sine from a figure: within 2 per cent of the printed energies
    np.testing.assert_allclose(record["energy"], work, rtol=0.02)


def test_modes_and_records_of_configuration_2_agree() -> None:
    for name in ("config-2-mode-1", "config-2-mode-2"):
        record, mode = report_record(name), tomllib.loads(describe_mode_text(name))
        C = record["force"] / (2 * np.pi * record["frequency"] * record["amplitude"])  # Eq. 4.1.7
        # the printed C_1 agree with Eq. 4.1.7 to 0.1 per cent, so does their mean
        assert mode["damping"]["viscous"] == pytest.approx(C.mean(), rel=1e-3)
        assert mode["mode"]["mass"] == pytest.approx(record["mass"].mean(), rel=1e-6)


def test_the_packaged_copy_comes_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    house = tmp_path / "site" / "pipelines" / "damping_reed1970"
    module = house / "tables.py"
    monkeypatch.setattr(report_tables, "__file__", str(module))
    with pytest.raises(InputError, match="not installed"):
        data_folder()
    shutil.copytree(FOLDER, tmp_path / "site" / "data" / "saturn-v")
    assert data_folder() == tmp_path / "site" / "data"
    shutil.copytree(FOLDER, house / "_data" / "saturn-v")
    assert data_folder() == house / "_data"
