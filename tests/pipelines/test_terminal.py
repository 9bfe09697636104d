"""What the terminal shows: whole numbers in 80 columns, pictures on request, an example under every help."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from damping.progress import unknown_length
from damping.report.forms import PART_NAMES
from damping_pipelines import QUIET
from damping_pipelines.cli import app
from damping_pipelines.laws import Asked, _name_laws, _state_frequency
from damping_pipelines.terminal import Notes, PlainTable, number_whole, print_lines, progress

#: A number that was cut: a digit beside what stands for the rest.
CUT = re.compile(r"\d…|…\d")


@pytest.mark.parametrize(("total", "lines"), [(3, 3), (10, 10), (65, 10), (2000, 10)])
def test_a_log_has_ten_lines_of_progress_at_most(total, lines, capsys):
    QUIET.set(False)  # a command run before in this process may have been quiet
    for each in (False, True):
        with progress("ranking", total, each=each) as advance:
            for part in range(total):
                advance(f"law {part + 1}")
        said = capsys.readouterr().err.splitlines()
        assert len(said) == (total if each else lines)
        assert said[-1] == f"ranking: {total}/{total} law {total}"


@pytest.mark.parametrize(("row", "said"), [
    ((31999.86, 31998.4, 32001.2), "31999.9 ± 1.5"), ((1.6662, 1.66, 1.67), "1.6662 ± 0.0062"),
    ((32000.0, 31800.0, 32150.0), "32000 ± 200"), ((54321.5, 54321.5, 54321.5), "54322"), ((np.nan,) * 3, "-"),
    ((38.0, 37.9998, 38.0), "38.00000 ± 0.00020"), ((41.0, 40.999937, 41.0), "41.000000 ± 0.000063"),
])  # fmt: skip
def test_a_frequency_is_rounded_by_its_band(row, said):
    assert _state_frequency(dict(zip(("frequency", "frequency_low", "frequency_high"), row, strict=True))) == said


def test_a_table_fits_and_keeps_its_numbers():
    table = PlainTable("weights", ("weight", "held-out error %", "score", "notes"), ("", "law"))
    long = "displacement-velocity + quadratic-displacement + coulomb + slip"
    table.add_row("1", long, "0.0971", "0.00123", "-10.25", "1 2 3")
    table.add_row("2", "viscous", "0.9", "12", "1234567.8", "")
    for width in (120, 80, 60, 40):
        lines = table.fit(width)
        assert all(len(line) <= width for line in lines)
        text = "\n".join(lines)
        assert all(number in text for number in ("0.0971", "0.00123", "-10.25", "1234567.8", "1 2 3"))
        assert not CUT.search(text)
    assert long in "\n".join(table.fit(120))


@pytest.mark.parametrize(("names", "width"), [((), 79), (("on the left",), 86)])
def test_a_table_as_wide_as_the_terminal_stays_one(names, width):
    """Columns of 7 characters, a name of 14, and a gap of 2 between each two: n columns have n - 1 gaps."""
    table = PlainTable("", [str(i) for i in range(9 - len(names))], names)
    table.add_row(*["a name in full"] * len(names), *["1234567"] * (9 - len(names)))
    assert [len(line) for line in table.fit(width)] == [width] * 3
    assert len(table.fit(width - 1)) > 3


def test_columns_that_do_not_fit_go_on_below_under_the_names():
    numbers = tuple(f"column {i}" for i in range(12))
    table = PlainTable("wide", numbers, ("sweep",))
    table.add_row("A", *(f"{i}.12345" for i in range(12)))
    lines = table.fit(60)
    assert sum(line.startswith("A ") for line in lines) >= 2
    assert all(f"{i}.12345" in "\n".join(lines) for i in range(12))
    table = PlainTable("without names", ("amplitude", *numbers[1:]))
    table.add_row(*(f"{i}.12345" for i in range(12)))
    for width in (60, 16):
        lines = table.fit(width)
        assert all(len(line) <= width for line in lines)
        assert sum(line.split()[:1] == ["0.12345"] for line in lines) == (1 if width == 16 else 3)


@pytest.mark.usefixtures("few_laws")
@pytest.mark.parametrize(
    "words",
    [("rank",), ("curve", "--amplitude", 1.4, "--force", 40), ("extrapolate", "--force", 45), ("check",)],
    ids=lambda words: words[0],
)
def test_tables_of_a_record(words, damping, saturn_data):
    """In 80 columns and with whole numbers: ``damping`` holds every command of every test to that."""
    record = saturn_data / "records" / "config-2-mode-1.csv"
    run = damping(words[0], record, "--mode", saturn_data / "modes" / "config-2-mode-1.toml", *words[1:])
    assert run.code == 0
    assert "\n---" in run.out


def test_laws_are_named_with_weights_that_three_decimals_show():
    laws = [SimpleNamespace(name=name, weight=w) for name, w in (("a", 0.9991), ("b", 6e-4), ("c", 2e-4), ("d", 1e-4))]
    assert _name_laws(laws) == "Laws by weight on rows near resonance: a 0.999, b 0.001, and 2 more."
    assert _name_laws(laws[:2]) == "Laws by weight on rows near resonance: a 0.999, b 0.001."


@pytest.mark.usefixtures("few_laws")
def test_tables_beside_each_other_have_one_unit_of_length(damping, tmp_path):
    """A band about 20 mm, where metres begin: its median is below, its high end above."""
    record, mode = tmp_path / "peaks.csv", tmp_path / "mode.toml"
    rows = (f"{i},{F},10.0,{0.0192 * (F / 12.0) ** 0.6:.5g}" for i, F in enumerate((1.0, 2.0, 4.0, 8.0)))
    record.write_text("\n".join(["sweep,force,frequency,amplitude", *rows]) + "\n")
    units = '[units]\nforce = "N"\nlength = "m"\n'
    mode.write_text(f'[mode]\nname = "panel"\nfrequency = 10.0\nmass = 2.0\n{units}')
    said = damping("extrapolate", record, "--mode", mode, "--force", 12, "--json", tmp_path / "loads.json").out
    (row,) = json.loads((tmp_path / "loads.json").read_text())["predictions"]
    assert row["median"] < 0.02 < row["high"]
    titles = [line for line in said.splitlines() if "amplitude at resonance [" in line or "with other priors [" in line]
    assert [title.split("[")[1] for title in titles] == ["m]", "m]"]
    explained = " ".join(said.split())
    assert all(f"{part} = " in explained for part in PART_NAMES.values())


def test_long_names_go_on_below():
    """Two laws that begin alike are told apart in whatever width holds their words; a number stands once."""
    laws = [f"viscous + velocity-squared + {last}" for last in ("slip", "coulomb")]
    table = PlainTable("laws", ("weight",), ("law",))
    for law in laws:
        table.add_row(law, "0.512345")
    lines = table.fit(30)
    assert all(len(line) <= 30 for line in lines)
    text = " ".join(" ".join(lines).replace("0.512345", "").split())
    assert all(law in text for law in laws)
    assert "".join(lines).count("0.512345") == 2


def test_prose_is_wrapped_not_shortened():
    table = PlainTable("read", (), ("what", "understood"))
    table.add_row("adjacent modes", "mode 1 0.034, mode 3 0.0061, mode 4 0.00212")
    lines = table.fit(40)
    assert all(len(line) <= 40 for line in lines)
    assert "mode 4 0.00212" in " ".join(" ".join(lines).split())


def test_names_from_files_are_printed_as_they_stand(capsys):
    """Brackets that could be a style, and what rich takes for an emoji: a node, a direction and a number."""
    name = "12:x:3 [red]g[/red]"
    print_lines(name)
    table = PlainTable("", ("1",), ("sensor",))
    table.add_row(name, "5")
    assert [capsys.readouterr().out.strip(), table.fit(40)[-1]] == [name, f"{name}  5"]


def test_wide_characters_take_two_columns():
    table = PlainTable("", ("周波数",), ("名",))
    table.add_row("梁", "1.5")
    assert table.fit(40) == ["名  周波数", "--  ------", "梁     1.5"]


def test_the_next_command_can_be_typed_as_it_stands():
    asked = Asked(Path("my record.csv"), Path("a'b.toml"), None, None, 0, 1, ())
    words = [
        "damping",
        "extrapolate",
        "my record.csv",
        "--mode",
        "a'b.toml",
        "--force",
        "1234567.5",
        "--amplitude",
        "2",
    ]
    assert shlex.split(asked.name("extrapolate", [1234567.5], [2.0])) == words


@pytest.mark.usefixtures("few_laws")
def test_the_other_way_round(damping, saturn_data, tmp_path):
    """The force for an amplitude: its form, its picture, its deck, and what comes next."""
    record, mode = saturn_data / "records" / "config-2-mode-1.csv", saturn_data / "modes" / "config-2-mode-1.toml"
    form, picture, deck = tmp_path / "loads.json", tmp_path / "loads.svg", tmp_path / "deck.bdf"
    options = ("--amplitude", 2.0, "--json", form, "--plot", picture)
    run = damping("extrapolate", record, "--mode", mode, *options)
    assert run.code == 0
    assert f"Next: damping export {form} --to nastran" in run.out
    prediction = json.loads(form.read_text())["predictions"][0]
    assert prediction["amplitude"] == 2.0
    assert prediction["low"] < prediction["median"] < prediction["high"]
    assert picture.read_text().startswith("<svg")
    assert damping("export", form, "--to", "nastran", "--out", deck).code == 0
    assert f"{prediction['damping_ratio']['low']:.9E}" in deck.read_text()
    curve = damping("curve", record, "--mode", mode, "--force", 1, "--force", 25, "--force", 50).out
    assert f"--mode {mode} --force 1 --force 25 --force 50 --json curve.json" in " ".join(curve.split())
    assert re.findall(r" (below|yes|beyond) ", curve)[:3] == ["below", "yes", "beyond"]  # tested from 19.3 to 29 lb
    assert damping("extrapolate", record, "--mode", mode).code == 2
    assert damping("extrapolate", record, "--mode", mode, "--force", 1, "--amplitude", 1).code == 2
    assert "svg or .png" in damping("rank", record, "--mode", mode, "--plot", tmp_path / "a.gif").err


@pytest.mark.usefixtures("few_laws")
def test_a_picture_that_cannot_be_drawn_changes_nothing(damping, saturn_data, tmp_path, monkeypatch):
    """A failed run leaves earlier results as they were, and says so in one line; no half of the answer gets out."""
    record, mode = saturn_data / "records" / "config-2-mode-1.csv", saturn_data / "modes" / "config-2-mode-1.toml"
    form, picture = tmp_path / "rank.json", tmp_path / "rank.svg"
    form.write_text("earlier")

    def fail(self):
        raise ValueError("no canvas")

    monkeypatch.setattr("damping.answers.RankingResult.plot", fail)
    for target in (form, "-"):
        run = damping("rank", record, "--mode", mode, "--json", target, "--plot", picture)
        assert run.code == 1
        assert run.out == ""
        assert "ValueError: no canvas" in run.err
        assert "Traceback" not in run.err
    assert form.read_text() == "earlier"
    assert not picture.exists()


@pytest.mark.parametrize("command", sorted(c.name or c.callback.__name__ for c in app.registered_commands))
def test_every_help_ends_with_an_example(command, damping):
    said = " ".join(damping(command, "--help").out.split())
    assert f"Example: damping {command} " in said


def test_numbers_of_notes_rise():
    notes = Notes()
    assert notes.numbers(["a", "b", "c"]) == "1 2 3"
    assert notes.numbers(["c", "d", "a"]) == "1 3 4"


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (30.9912, 5, "30.991"),
        (36.0, 5, "36.000"),
        (0.62, 5, "0.62000"),
        (32000.0, 5, "32000"),
        (123456.0, 5, "123456"),
        (1300.0, 3, "1300"),
        (0.3, 3, "0.300"),
        (100.0, 3, "100"),
        (999.7, 3, "1000"),
        (float("nan"), 3, "-"),
    ],
)
def test_numbers_beside_each_other_have_even_digits(value, digits, text):
    assert number_whole(value, digits, "#") == text


def test_progress_of_unknown_length_goes_on_and_ends_whole():
    shown = []

    @contextmanager
    def progress(title, total):
        yield lambda what, parts=1: shown.append(parts)

    with unknown_length(progress, "diagnosing", 10) as report:
        for _ in range(10):
            report("a fit")
        assert sum(shown) == 50  # a half after the usual number
        for _ in range(1000):
            report("a further fit")
        assert 95 < sum(shown) < 100
    assert sum(shown) == 100


def test_a_home_folder_that_cannot_be_written_adds_no_line(tmp_path):
    """A failed command says one line on standard error; matplotlib would report its cache on two more."""
    (tmp_path / "file").touch()  # no folder, so that even root cannot make one in it
    words = (sys.executable, "-c", "import damping_pipelines, matplotlib; matplotlib.get_cachedir()")
    environment = {**os.environ, "MPLCONFIGDIR": str(tmp_path / "file" / "cache")}
    run = subprocess.run(words, env=environment, capture_output=True, text=True, check=True)
    assert run.stderr == ""
