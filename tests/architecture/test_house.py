"""The shape of the house, kept so: names told apart, few scraps of files, no long function, no joint constants."""

import ast

from tests.architecture import measure_house


def test_class_names_are_unique():
    assert measure_house.duplicate_classes() == {}


def test_every_constant_has_an_assignment_of_its_own():
    assert measure_house.tuple_constants() == []


def test_few_files_are_scraps():
    assert len([n for n in measure_house.file_lines().values() if n < measure_house.SHORT]) <= measure_house.MOST_SHORT


def test_no_function_is_long():
    every = [function for path in measure_house.modules() for function in measure_house.functions(path)]
    assert [(str(f.path), f.name) for f in every if f.lines > measure_house.LONGEST] == []


def test_every_refused_input_says_what_was_expected():
    """Part of the interface: one line that names file, line and column, and what was expected."""
    calls = [
        (path, node)
        for path in measure_house.modules()
        for node in ast.walk(measure_house.parse(path))
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "InputError"
    ]
    assert len(calls) > 100
    silent = [f"{path}:{call.lineno}" for path, call in calls if "expected" not in {word.arg for word in call.keywords}]
    assert silent == []
