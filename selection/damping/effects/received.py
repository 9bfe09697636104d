"""A force that is not the recorded one: it drops out near resonance or at large motion, or its cell is not linear."""

from collections.abc import Callable, Mapping

import numpy as np

from damping.arrays import FloatArray, Floats, differs
from damping.effects.contract import Drive, Effect, Form, FormVariable, Instrument, Scales, Terms
from damping.forces.shapes import LENGTH, Shape

#: Shape of the dip over the distance from its centre in widths: 1 at the centre, 0 far away. ``receptance`` is |H|.
NOTCHES: dict[str, Callable[[Floats], Floats]] = {
    "gaussian": lambda x: np.exp(-0.5 * np.square(x)),
    "lorentzian": lambda x: 1.0 / (1.0 + np.square(x)),
    "receptance": lambda x: 1.0 / np.sqrt(1.0 + np.square(x)),
}
#: Width, in ln of the motion, of a force that falls with it: 1 over the power of the motion in lost over kept force.
_LIMIT = FormVariable.between(0.12, 1.0, starts=(0.0,))
_CELL_POWER = FormVariable.between(0.5, 3.0, starts=(0.0,))  #: power of the force in the error of its reading


def dropout_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: depth/(1 - depth). Shapes: width over omega_n, half the bandwidth to the measured band; centre.

    Over the motion: depth at its largest amplitude; the width is that in ln amplitude.
    """
    width = FormVariable.between(0.5 * scales.bandwidth, max(scales.reach, 4.0 * scales.bandwidth), (-1.0, 0.0, 1.0))
    centre = FormVariable(0.0, scales.bandwidth, starts=(0.0,), linear=True)
    dips = (*(_dip_form(notch, (width,)) for notch in NOTCHES), _dip_form("gaussian", (width, centre)))

    def report(strength: Floats, width: Floats) -> dict[str, Floats]:
        return {"depth": strength / (1.0 + strength), "width": width, "level": scales.A_high}

    return (*dips, FORCE_DROPOUT.form(report, 0.2, shapes=(_LIMIT,), largest=20.0))


def _dip_form(notch: str, shapes: tuple[FormVariable, ...]) -> Form:
    def report(strength: Floats, width: Floats, centre: Floats | None = None) -> dict[str, Floats]:
        kind = {} if notch == "gaussian" else {notch: 1.0}
        place = {} if centre is None else {"centre": centre}
        return {"depth": strength / (1.0 + strength), "width": width} | place | kind

    return FORCE_DROPOUT.form(report, 0.2, shapes=shapes, largest=20.0)


def limiting(depth: Floats, width: Floats, level: Floats) -> Instrument:
    """ln of the share of the force that is left at motion A, 1/(1 + depth/(1 - depth) (A/level)^(1/width))."""
    odds, base = depth / (1.0 - depth), np.log(level)

    def left(v: FloatArray) -> tuple[FloatArray, FloatArray]:
        lost = odds * np.exp(np.clip((v - base) / width, -50.0, 50.0))
        return -np.log1p(lost), -lost / ((1.0 + lost) * width)

    return left


def simulate_dropout(terms: Terms, table: Mapping[str, Floats]) -> Terms:
    """The force times 1 - ``depth`` notch((omega/omega_n - 1 - ``centre``)/``width``).

    The notch is Gaussian unless the value of another is not 0. Where a ``level`` is given, the force falls with the
    motion instead, see `limiting`.
    """
    if differs(table["level"], 0.0):
        return terms.plus(limited=limiting(table["depth"], table["width"], table["level"]))
    notch = next((name for name in ("lorentzian", "receptance") if table[name]), "gaussian")
    omega_n = terms.omega_n

    def received(drive: Drive) -> Floats:
        place = (drive.omega / omega_n - 1.0 - table["centre"]) / table["width"]
        return np.log1p(-table["depth"] * NOTCHES[notch](place))

    return terms.plus(received=received)


FORCE_DROPOUT = Effect(
    name="force-dropout",
    kind="instrument",
    sentence="the real force falls below the recorded one near resonance",
    forms=dropout_forms,
    simulate=simulate_dropout,
    shapes=(
        Shape("depth", least=0.0, below=1.0),
        Shape("width", above=0.0),
        Shape("centre", default=0.0),
        Shape("lorentzian", least=0.0, default=0.0),
        Shape("receptance", least=0.0, default=0.0),
        Shape("level", LENGTH, least=0.0, default=0.0),
    ),
    need="sweep",
)


def cell_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: |ln| of actual over recorded force at the force that damping carries at the largest amplitude."""
    largest = scales.loss * scales.A_high

    def report(size: Floats, power: Floats) -> dict[str, Floats]:
        return {"coefficient": size / largest**power, "power": power}

    return FORCE_CELL.either_sign(report, shapes=(_CELL_POWER,), largest=1.0)


FORCE_CELL = Effect(
    name="force-cell",
    kind="instrument",
    sentence="a force that is read wrong in proportion to a power of itself",
    forms=cell_forms,
    simulate=lambda terms, table: terms.plus(received=lambda drive: table["coefficient"] * drive.F ** table["power"]),
    need="sweep",
)
