"""Mode files: what they may hold, every refusal with its line, and the round trip."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from damping import effects
from damping.errors import InputError
from damping.forces import CATALOGUE, list_parameter_names
from damping.predict import in_unit
from damping.records.keys import MAX_TOML_SIZE
from damping.records.mode import Mode, Repeatability, Tolerance, Units, describe_mode_to_toml, read_mode
from tests.files import outcome

MODE = '[mode]\nname = "first"\nfrequency = 2.5 # Hz\nmass = 3\n'
FORCES = ", ".join(CATALOGUE)
EFFECTS = ", ".join(effects.CATALOGUE)

WHOLE = """\
[mode]
name = "Configuration II, first mode"
frequency = 1.5
mass = 2

[mode.tolerance]
mass = 0.01

[repeatability]
frequency = 0.002

[units]
force = "lb"
length = "in"
time = "s"

[damping]
viscous = 1.77
velocity-squared = {coefficient = 0.23}
velocity-power = {coefficient = 0.19, exponent = 1.65}

[damping.slip]
stiffness = 40.0
limit = 0.01

[effects.phase-lag]
lag = -0.05
[effects.planar-coupling]
angle = 0.3
frequency_ratio = 1.02
"""


def added(text: str, said: str) -> tuple[str, str]:
    """Further lines of a mode file, and what is said of the last of them."""
    return f"{MODE}{text}\n", f", line {4 + len(text.splitlines())}, column {said}"


def changed(old: str, new: str, said: str) -> tuple[str, str]:
    """A mode file with something else in its first place, and what is said."""
    return MODE.replace(old, new), f", line {said}"


STIFFNESS = (
    "is 741; expected at most 740.22, the stiffness of the mode, mass times (2 pi frequency)^2"  # 3 (2 pi 2.5)^2
)
POSITIVE_NUMBER = "expected a number > 0"
# content, and what the error says after the name of the file
REFUSED = {
    "empty": ("", ": the file is empty; expected a file with contents"),
    "not UTF-8": (
        MODE.encode() + b"# \xe9\n",
        ", line 5: byte 0xe9 at byte 3 of the line is not UTF-8 text; expected text in UTF-8",
    ),
    "nested": (MODE + "x = " + "[" * 5000, ": not TOML: nested too deeply; expected tables of a mode"),
    "no mode": ("[damping]\nviscous = 1\n", ": no table [mode]; expected [mode]"),
    "mode is no table": ("mode = 1\n", ", line 1, column mode: is a number; expected a table"),
    "no mass": changed("mass", "# mass", "1: no mass in [mode]; " + POSITIVE_NUMBER),
    "unknown table": added(
        "[repeatibility]",
        "repeatibility: unknown key; "
        "expected repeatability (nearest of mode, repeatability, units, rig, damping, effects)",
    ),
    "unknown key": (
        "# frequncy\n" + MODE + "frequncy = 1\n",
        ", line 6, column frequncy: unknown key in [mode]; "
        "expected frequency (nearest of name, frequency, mass, drive, tolerance)",
    ),
    "no plane": added("[rig]\nplanes = 0", "planes: is 0; expected 1 or 2"),
    "unknown tolerance": added(
        "[mode.tolerance]\nmass = 0.1\n\nfreq = 1",
        "freq: unknown key in [mode.tolerance]; expected frequency (nearest of frequency, mass, viscous, from_record)",
    ),
    "unknown unit": (
        'units.lenght = "m"\n' + MODE,
        ", line 1, column lenght: unknown key in [units]; expected length (nearest of force, length, time)",
    ),
    "unknown force": added(
        "[damping]\nviscous = 1\nvelocity-sqared = 2",
        f"velocity-sqared: unknown key in [damping]; expected velocity-squared (nearest of {FORCES})",
    ),
    "unknown inline": added(
        "[damping]\nvelocity-power = {coefficient = 1, exponant = 2}",
        "exponant: unknown key in [damping.velocity-power]; expected exponent (nearest of coefficient, exponent)",
    ),
    "unknown effect": (
        MODE + "[effects.coulomb-fraction]\nlevel = 1\n",
        ", line 5, column coulomb-fraction: unknown key in [effects]; "
        f"expected coulomb-friction (nearest of {EFFECTS})",
    ),
    "number as text": changed("3", '"3"', "4, column mass: is text; " + POSITIVE_NUMBER),
    "number as flag": changed("3", "true", "4, column mass: is true or false; " + POSITIVE_NUMBER),
    "number as date": changed("3", "2001-02-03", "4, column mass: is a date or time; " + POSITIVE_NUMBER),
    "list over lines": changed("3", "[\n1,\n2]", "4, column mass: is a list; " + POSITIVE_NUMBER),
    "text as number": changed('"first"', "1", "2, column name: is a number; expected a text in quotes"),
    "nan": changed("3", "nan", "4, column mass: is nan; " + POSITIVE_NUMBER),
    "inf": changed("2.5", "inf", "3, column frequency: is inf; " + POSITIVE_NUMBER),
    "large": changed("3", "1e51", "4, column mass: is 1e+51; expected a magnitude of 1e-50 to 1e+50"),
    "huge": changed("3", "1" + "0" * 400, "4, column mass: is inf; " + POSITIVE_NUMBER),
    "zero mass": changed("3", "0", "4, column mass: is 0; " + POSITIVE_NUMBER),
    "negative frequency": changed("2.5", "-2.5", "3, column frequency: is -2.5; " + POSITIVE_NUMBER),
    "tolerance": added("[mode.tolerance]\nmass = -0.1", "mass: is -0.1; expected a number >= 0"),
    "repeatability": added("[repeatability]\namplitude = -0.1", "amplitude: is -0.1; expected a number >= 0"),
    "coefficient": added("[damping]\nviscous = -1", "viscous: is -1; expected a number >= 0"),
    "force as number": added("[damping]\nslip = 1", "slip: is a number; expected {stiffness = ..., limit = ...}"),
    "no exponent": (
        MODE + "[damping.velocity-power]\ncoefficient = 1\n",
        ", line 5: no exponent in [damping.velocity-power]; expected a number > 0",
    ),
    "zero limit": added("[damping]\nslip = {stiffness = 1, limit = 0}", "limit: is 0; " + POSITIVE_NUMBER),
    "key of the effect": added(
        "[damping]\nslip = {stiffness = 1, limit = 0.1, kappa = 1}",
        "kappa: a key of [effects.slip], not of [damping.slip]; expected {stiffness = ..., limit = ...}, or all of it "
        "in [effects.slip]",
    ),
    "all of the stiffness lost": added("[damping]\nslip = {stiffness = 741, limit = 0.1}", "stiffness: " + STIFFNESS),
    "all of it, by the joint of Dahl": added(
        "[damping]\ndahl = {stiffness = 741, limit = 0.1}", "stiffness: " + STIFFNESS
    ),
    "all of it, by an effect": added("[effects.slip]\nlimit = 0.1\nstiffness = 741", "stiffness: " + STIFFNESS),
    "effect": added('[effects.phase-lag]\nlag = "c"', "lag: is text; expected a number > -6.28319 and < 6.28319"),
    "key of an effect": added(
        "[effects.stiffness-hardening]\ncoefficient = 1\nexponant = 2",
        "exponant: unknown key in [effects.stiffness-hardening]; expected exponent (nearest of coefficient, exponent)",
    ),
    "no key of an effect": (
        MODE + "[effects.slip]\nstiffness = 1\n",
        ", line 5: no limit in [effects.slip]; expected a number > 0",
    ),
    "zero width": added("[effects.force-dropout]\ndepth = 0.5\nwidth = 0", "width: is 0; " + POSITIVE_NUMBER),
    "all of the force lost": (
        MODE + "[effects.force-dropout]\ndepth = 1\nwidth = 0.1\n",
        ", line 6, column depth: is 1; expected a number >= 0 and < 1",
    ),
    "lag in degrees": added(
        "[effects.phase-lag]\nlag = 11.5", "lag: is 11.5; expected a number > -6.28319 and < 6.28319"
    ),
    "angle in degrees": added(
        "[effects.planar-coupling]\nfrequency_ratio = 1.02\nangle = 30",
        "angle: is 30; expected a number > -6.28319 and < 6.28319",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused_in_one_line_that_names_the_place(case, scratch):
    content, said = REFUSED[case]
    path = scratch(content, "mode.toml")
    with pytest.raises(InputError) as caught:
        read_mode(path)
    assert str(caught.value) == f"{path}{said}"
    assert len(str(caught.value).splitlines()) == 1


# the wording after "not TOML" is that of the Python version
@pytest.mark.parametrize(
    ("content", "place"),
    [
        (MODE + "[damping\n", ", line 5, column 9: not TOML: "),
        (MODE + "[damping]\nviscous =", ", line 6: not TOML: "),
        (MODE.replace('first"', "first"), ", line 2, column 14: not TOML: "),
        (MODE + "mass = 4\n", ", line 5, column 9: not TOML: "),
    ],
)
def test_syntax_errors_name_the_place(content, place, scratch):
    path = scratch(content, "mode.toml")
    with pytest.raises(InputError) as caught:
        read_mode(path)
    assert str(caught.value).startswith(f"{path}{place}")
    assert len(str(caught.value).splitlines()) == 1


def test_sizes_are_bounded(scratch):
    path = scratch(MODE, "mode.toml")
    with pytest.raises(InputError, match="larger than 10 bytes"):
        read_mode(path, max_size=10)
    with pytest.raises(InputError, match=f"larger than {MAX_TOML_SIZE} bytes"):
        read_mode(scratch(MODE + "#" * MAX_TOML_SIZE, "mode.toml"))
    with pytest.raises(InputError, match=r"not TOML: .* integer string conversion"):
        read_mode(scratch(MODE + "x = " + "1" * 5000, "mode.toml"))


def test_a_file_with_everything_is_read(scratch):
    mode = read_mode(scratch(WHOLE, "mode.toml"))
    assert mode.name == "Configuration II, first mode"
    assert mode.omega_n == 2 * pi * 1.5
    assert mode.mass == 2.0
    assert mode.tolerance == Tolerance(frequency=0.001, mass=0.01, viscous=0.05)
    assert mode.repeatability == Repeatability(amplitude=None, frequency=0.002)
    assert str(mode.units) == "force in lb, length in in, time in s"
    assert mode.damping == {
        "viscous": {"coefficient": 1.77},
        "velocity-squared": {"coefficient": 0.23},
        "velocity-power": {"coefficient": 0.19, "exponent": 1.65},
        "slip": {"stiffness": 40.0, "limit": 0.01},
    }
    assert mode.effects == {"phase-lag": {"lag": -0.05}, "planar-coupling": {"angle": 0.3, "frequency_ratio": 1.02}}
    assert replace(read_mode(scratch(describe_mode_to_toml(mode), "mode.toml")), source=mode.source) == mode


def test_what_a_file_leaves_out_has_a_default(scratch):
    path = scratch(("\ufeff" + MODE.replace('name = "first"\n', "")).replace("\n", "\r\n"), "a mode.toml")
    assert read_mode(path) == Mode(name="a mode", frequency=2.5, mass=3.0, source=str(path))
    assert str(Units()) == "one consistent system of units"


POSITIVE = st.floats(min_value=1e-50, max_value=1e50)
TEXT = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)


def tables(effect):
    """Any table that an effect may have; parameters that have a default may be absent."""
    fits = {s.name: st.floats(max(s.least, 1e-50), min(0.99 * s.below, 1e50)) for s in effect.shapes}
    fits |= {s.name: st.sampled_from([0.0, 1.0]) for s in effect.shapes if s.switch}
    needed = {s.name for s in effect.shapes if s.default is None}
    return st.fixed_dictionaries(
        {name: fit for name, fit in fits.items() if name in needed},
        optional={name: fit for name, fit in fits.items() if name not in needed},
    ).filter(lambda table: all(is_alone_or_led(s, table) for s in effect.shapes))


def is_alone_or_led(shape, table):
    """Whether what the parameter excludes is absent, and what it needs is there."""
    value = table.get(shape.name, shape.default)
    led = not shape.needs or value == shape.default or table.get(shape.needs)
    return led and not (value and table.get(shape.excludes))


def build(frequency, mass, damping, **rest):
    """A mode whose joint loses no more stiffness than there is; none where that is too small a number."""
    K = mass * (2.0 * pi * frequency) ** 2
    for forces in (damping, rest["effects"]):
        for name in ("slip", "dahl"):
            joint = forces.pop(name, None)
            forces |= {name: joint | {"stiffness": min(joint["stiffness"], K)}} if joint and K >= 1e-50 else {}
    return Mode(frequency=frequency, mass=mass, damping=damping, **rest)


MODES = st.builds(
    build,
    name=TEXT.filter(lambda text: "\r" not in text and "\n" not in text),
    frequency=POSITIVE,
    mass=POSITIVE,
    tolerance=st.builds(Tolerance, POSITIVE, POSITIVE, POSITIVE),
    repeatability=st.builds(Repeatability, st.none() | POSITIVE, st.none() | POSITIVE),
    units=st.builds(Units, TEXT, TEXT, TEXT),
    damping=st.fixed_dictionaries(
        {},
        optional={
            name: st.fixed_dictionaries(dict.fromkeys(list_parameter_names(name), POSITIVE)) for name in CATALOGUE
        },
    ),
    effects=st.fixed_dictionaries({}, optional={name: tables(effect) for name, effect in effects.CATALOGUE.items()}),
)


@settings(deadline=None, max_examples=100)
@given(mode=MODES)
def test_any_mode_is_read_back_as_it_was_written(mode, scratch):
    path = scratch(describe_mode_to_toml(mode), "mode.toml")
    assert read_mode(path) == replace(mode, source=str(path))


WORDS = st.sampled_from([*'[]=\n.1"{},é\0', "-1", "nan", "'''", "mode", "mass", "frequency", "damping", "slip"])


@settings(deadline=None, max_examples=150)
@given(
    content=st.one_of(
        st.binary(max_size=100),
        st.lists(WORDS, max_size=30).map(lambda words: "".join(words).encode()),
        st.lists(WORDS, max_size=12).map(lambda words: (MODE + "".join(words)).encode()),
    )
)
def test_anything_is_a_mode_or_bad_input(content, scratch):
    mode, error = outcome(read_mode, scratch(content, "mode.toml"))
    if error is None:
        assert mode.mass > 0.0
        assert mode.frequency > 0.0
    else:
        assert len(str(error).splitlines()) == 1


def test_a_switch_is_on_or_off(scratch):
    slip = "\n[effects.slip]\nstiffness = 1.0\nlimit = 0.1\nkappa = 1.0\nbounded = "
    assert read_mode(scratch(MODE + slip + "1\n", "mode.toml")).effects["slip"]["bounded"] == 1.0
    for alone, by in (("bounded = 1", "kappa"), ("relief = 2", "smooth")):
        with pytest.raises(InputError, match=rf"says nothing without {by}; expected {by} beside it"):
            read_mode(scratch(MODE + slip.partition("kappa")[0] + alone + "\n", "mode.toml"))
    with pytest.raises(InputError, match=r"bounded: is 0\.5; expected 0 or 1"):
        read_mode(scratch(MODE + slip + "0.5\n", "mode.toml"))


def test_a_joint_that_yields_gradually_is_one_joint(scratch):
    slip = "\n[effects.slip]\nstiffness = 1.0\nlimit = 0.1\nsmooth = {}\nkappa = 1.0\n"
    assert read_mode(scratch(MODE + slip.format("0"), "mode.toml")).effects["slip"]["kappa"] == 1.0
    place = r"mode\.toml, line 9, column smooth: stands beside kappa; expected one of the two"
    with pytest.raises(InputError, match=place):
        read_mode(scratch(MODE + slip.format("1"), "mode.toml"))


def test_a_joint_that_loses_all_the_stiffness_keeps_it_in_other_units():
    """The last digit of mass times (2 pi frequency)^2 depends on the unit of mass."""
    for f, mass, unit in np.random.default_rng(0).uniform(0.1, 90.0, (50, 3)):
        joint = {"slip": {"stiffness": mass * (2.0 * pi * f) ** 2, "limit": 0.1}}
        for tables in ({"damping": joint}, {"effects": joint}):
            assert in_unit(Mode(name="m", frequency=f, mass=mass, **tables), unit).mass == mass * (1.0 / unit)
