"""The shape of the house, kept so: names told apart, few scraps of files, no long function, no joint constants."""

import runpy
from pathlib import Path

HOUSE = runpy.run_path(str(Path(__file__).parent / "measure_house.py"))
#: Modules whose constants still share assignments, and class names still defined twice: none may be added.
SHARED = Path(__file__).parent / "shared_names.txt"


def still_shared() -> dict[str, set[str]]:
    """What ``shared_names.txt`` lists, by kind: ``class NAME`` and ``constants MODULE``."""
    found: dict[str, set[str]] = {"class": set(), "constants": set()}
    for line in SHARED.read_text().splitlines():
        if line and not line.startswith("#"):
            kind, what = line.split()
            found[kind].add(what)
    return found


def test_class_names_are_unique():
    assert set(HOUSE["duplicate_classes"]()) <= still_shared()["class"]


def test_every_constant_has_an_assignment_of_its_own():
    modules = {place.split(":")[0] for place in HOUSE["tuple_constants"]()}
    assert modules <= still_shared()["constants"]


def test_nothing_that_was_mended_stays_listed():
    """The list only shrinks: delete it and this test when it is empty."""
    modules = {place.split(":")[0] for place in HOUSE["tuple_constants"]()}
    assert still_shared() == {"class": set(HOUSE["duplicate_classes"]()), "constants": modules}


def test_few_files_are_scraps():
    assert len([n for n in HOUSE["file_lines"]().values() if n < HOUSE["SHORT"]]) <= HOUSE["MOST_SHORT"]


def test_no_function_is_long():
    every = [function for path in HOUSE["modules"]() for function in HOUSE["functions"](path)]
    assert [(str(f.path), f.name) for f in every if f.lines > HOUSE["LONGEST"]] == []
