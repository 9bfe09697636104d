"""The shipped table of the blind run is that of the results, and tells the goals of the diagnosis."""

from pathlib import Path

from damping_validation.scorer_output import COLUMNS, load_blind_table

ROOT = Path(__file__).parents[2]


def test_the_table_is_that_of_the_results():
    shipped, result = (ROOT / folder / "blind" / "table.csv" for folder in ("data", "results"))
    assert shipped.read_bytes() == result.read_bytes()


def test_every_figure_has_its_cases():
    table = load_blind_table()
    assert tuple(table.columns) == COLUMNS
    null = table.set_index("figure").loc["null cases wrongly accused"]
    assert null["cases"] >= 500 or null["met"] == "no"  # fewer could not show one per cent
    assert table.loc[table["goal"] != "", "met"].isin(["yes", "no"]).all()
    # the calibration error of resampled cases is larger than that of the cases: its interval may lie above it
    others = table[table["figure"] != "expected calibration error"].dropna(subset="low")
    assert ((others["low"] <= others["measured"]) & (others["measured"] <= others["high"])).all()
