"""CONTRIBUTING.md, done to the letter in a copy of the tree: a new force and a new effect, used by every command."""

from __future__ import annotations

import json
import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "CONTRIBUTING.md").read_text()
#: The files of the page; the imports, by the file they go to; the lines of catalogues, in the same order.
FILES = dict(
    zip(re.findall(r"The file,\s`([^`]+)`", TEXT), re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL), strict=True)
)
IMPORTS = re.findall(r"The import, in `([^`]+)`:\n\n```\n(.*?)```", TEXT, re.DOTALL)
LINES = re.findall(r"The line at the end of `CATALOGUE` there:\n\n```\n(.*?)```", TEXT, re.DOTALL)

MODE = """[mode]
name = "m"
frequency = 2.0
mass = 1.5
[mode.tolerance]
frequency = 0.0001
mass = 0.001
viscous = 0.01
[repeatability]
amplitude = 0.0
frequency = 0.0
[units]
force = "lb"
length = "in"
time = "s"
[damping]
viscous = 0.4
"""
CUBED = "velocity-cubed = 0.002\n"
TILT = "[effects.force-tilt]\nslope = 3.0\nomega_n = 12.566370614359172\n"
SWEEPS = ("--force", "4", "--force", "10", "--force", "25", "--frequency", "1.9:2.1:9")
HIGHEST = ("--force", "25", "--frequency", "1.9:2.1:5")

#: A process that runs each line that it is given as words of ``damping``, and answers with code, output and errors.
EVERY_LINE = """
import contextlib, io, json, shlex, sys
from damping_pipelines.cli import main
for line in sys.stdin:
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main(shlex.split(line))
        except SystemExit as stopped:
            code = stopped.code or 0
    print(json.dumps([code, out.getvalue(), err.getvalue()]), flush=True)
"""


def test_commands_and_files_of_the_page_exist():
    makefile = (ROOT / "Makefile").read_text()
    for target in re.findall(r"^make (\w+)", TEXT, re.MULTILINE):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target
    named = set(re.findall(r"`((?:selection|pipelines|tests|docs)/[\w/.]+\.(?:py|md))`", TEXT))
    assert len(named) > 6
    assert [name for name in named if not (ROOT / name).is_file() and name not in FILES] == []


@pytest.fixture(scope="module")
def copy(tmp_path_factory, forking):
    """A copy of the tree with what the page says done to it, and a function that runs ``damping`` there."""
    folder = tmp_path_factory.mktemp("copy")
    for house in ("selection", "pipelines"):
        shutil.copytree(ROOT / house, folder / house, ignore=shutil.ignore_patterns("__pycache__"))
    for path, content in FILES.items():
        assert not (folder / path).exists()
        (folder / path).write_text(content)
    assert len(FILES) == len(IMPORTS) == len(LINES) == 2
    for (path, line), entry in zip(IMPORTS, LINES, strict=True):
        module = folder / path
        head, start, rest = module.read_text().partition("CATALOGUE: ")
        entries, end, tail = rest.partition("    )\n}" if entry.startswith("        ") else "}")
        head = head.replace("\nfrom damping", f"\n{line}from damping", 1)
        module.write_text(head + start + entries + entry + end + tail)
    (folder / "plain.toml").write_text(MODE)
    (folder / "cubed.toml").write_text(MODE + CUBED)
    (folder / "tilted.toml").write_text(MODE + TILT)
    (folder / "both.toml").write_text(MODE + CUBED + TILT)

    houses = [folder / house for house in ("selection", "pipelines")]
    process, asked, answered = forking.talk(EVERY_LINE, folder=folder, paths=houses)

    def damping(*words: str) -> str:
        print(shlex.join(words), file=asked, flush=True)
        code, printed, said = json.loads(answered.readline())
        assert code == 0, said
        return printed

    damping("sweep", "cubed.toml", *SWEEPS, "--out", "cubed.csv")
    yield folder, damping
    asked.close()
    process.wait()


def test_the_force_is_swept_in_time_as_by_averages(copy):
    """At the highest force, where the damping departs most from a linear one."""
    folder, damping = copy
    for method in ("ritz", "time"):
        damping("sweep", "cubed.toml", *HIGHEST, "--out", f"{method}.csv", "--method", method)
    averaged, integrated = (
        np.loadtxt(folder / name, delimiter=",", skiprows=1, usecols=(3, 4)) for name in ("ritz.csv", "time.csv")
    )
    # the averages leave out the third harmonic: at 4 % of critical damping, a third of the damping force 0.08 K A on
    # 8 K moves 0.3 % of A; phases of a few tenths of rad feel it as 0.5 %
    np.testing.assert_allclose(averaged, integrated, rtol=5e-3, atol=0.0)


def test_the_force_is_a_candidate_and_wins_on_its_own_data(copy):
    _, damping = copy
    models = json.loads(damping("rank", "cubed.csv", "--mode", "plain.toml", "--seed", "1", "--json", "-"))["models"]
    assert {"velocity-cubed", "viscous + velocity-cubed"} <= {model["name"] for model in models}
    assert models[0]["name"] == "viscous + velocity-cubed"
    found = [force["coefficient"] for force in models[0]["forces"]]
    # the rows are exact; the prior of the scatter is 2 per cent of 27 rows
    np.testing.assert_allclose(found, [0.4, 0.002], rtol=0.02, atol=0.0)


def test_both_are_converted_to_other_units(copy):
    folder, damping = copy
    damping("export", "cubed.csv", "--mode", "both.toml", "--units", "si", "--out", "si.csv", "--mode-out", "si.toml")
    text = (folder / "si.toml").read_text()
    values = {key: float(value) for key, value in re.findall(r"^([\w-]+) = (-?[\d.e+-]+)$", text, re.MULTILINE)}
    pound_force, inch = 4.4482216152605, 0.0254  # by definition, N and m
    # rounding of a few products
    np.testing.assert_allclose(values["velocity-cubed"], 0.002 * pound_force / inch**3, rtol=1e-14, atol=0.0)
    assert (values["slope"], values["omega_n"]) == (3.0, 12.566370614359172)


@pytest.mark.slow
def test_the_effect_is_found_in_its_own_data(copy):
    _, damping = copy
    damping("sweep", "tilted.toml", *SWEEPS, "--out", "tilted.csv")
    words = ("gap", "plain.toml", "tilted.csv", "--no-posterior", "--seed", "1", "--json", "-")
    found = json.loads(damping(*words))
    assert found["effects"] == ["force-tilt"]
    # the rows are exact; the noise that is taken from them is none to speak of
    np.testing.assert_allclose(found["parameters"]["force-tilt"]["slope"], 3.0, rtol=0.02, atol=0.0)
