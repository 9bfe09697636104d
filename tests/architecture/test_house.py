"""The shape of the house, kept so: names told apart, few scraps of files, no long function, no joint constants."""

import runpy
from pathlib import Path

HOUSE = runpy.run_path(str(Path(__file__).parent / "measure_house.py"))


def test_class_names_are_unique():
    assert HOUSE["duplicate_classes"]() == {}


def test_every_constant_has_an_assignment_of_its_own():
    assert HOUSE["tuple_constants"]() == []


def test_few_files_are_scraps():
    assert len([n for n in HOUSE["file_lines"]().values() if n < HOUSE["SHORT"]]) <= HOUSE["MOST_SHORT"]


def test_no_function_is_long():
    every = [function for path in HOUSE["modules"]() for function in HOUSE["functions"](path)]
    assert [(str(f.path), f.name) for f in every if f.lines > HOUSE["LONGEST"]] == []
