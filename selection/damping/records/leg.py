"""A run with its phases as lags of the displacement: whether it holds a resonance, and the mass that it shows."""

from dataclasses import dataclass
from functools import cached_property

from damping.arrays import FloatArray
from damping.records.implied import Implied, estimate_mass_without_phase
from damping.records.runs import FEWEST_ROWS, Run, has_resonance

SURE = 0.2  #: relative scatter beyond which the mass from pairs of rows is unknown
#: The same of a line through a run too short for pairs. Of 683 such runs of six laws, with cubic springs, neighbours or
#: one wing alone, none below it is off by more than a factor of 1.67, none has an offset beyond 0.68 rad.
SURE_OF_LINE = 0.05
#: Misfit of Re Y by a straight line from which a run does not show its mass. Below it are 444 of 470 runs of six laws,
#: all within a factor of 1.27, and 67 of 325 read in steps of a tenth to a third, one of which is off by more.
STRAIGHT = 0.1


@dataclass(frozen=True)
class Leg:
    """A run, what its phases as recorded imply (``turn``), and the corrected ``lag`` (n,).

    ``lag`` is None without phases or if they are incoherent.
    """

    run: Run
    turn: Implied | None
    lag: FloatArray | None

    @cached_property
    def resonant(self) -> bool:
        """Whether the run contains a resonance; a run of few rows is assumed to."""
        return len(self.run) < FEWEST_ROWS or has_resonance(self.run, self.lag)

    @property
    def on_line(self) -> bool:
        """Whether Re Y of its rows lies on a line, as far as phases tell.

        Readings near the resolution of an instrument do not: the smaller they are, the smaller the mass.
        """
        return self.turn is None or self.lag is None or self.turn.bend < STRAIGHT

    @property
    def paired(self) -> bool:
        """Whether phases on both sides of resonance show the mass, whatever the spring."""
        return self.turn is not None and self.lag is not None and self.turn.both_sides

    @cached_property
    def mass(self) -> tuple[float, bool]:
        """Mass that the run implies (NaN: none), and whether from phases or from a resonance that is not bent."""
        if self.turn is None or self.lag is None:
            return estimate_mass_without_phase(self.run) or (float("nan"), False)
        sure = self.turn.scatter < (SURE if self.turn.both_sides else SURE_OF_LINE)
        return abs(self.turn.mass) if sure else float("nan"), True
