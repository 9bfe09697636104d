"""What frequency response functions were measured with: a sine of their level, or an excitation that has none."""

import re
from collections.abc import Iterable

from damping.formats.series import Summary
from damping.records.text import describe_shortened

#: Words for an excitation whose response at one frequency is not that to a sine of the stated amplitude; German,
#: French, Spanish and Italian ones too.
BROADBAND = re.compile(
    r"(?i)(?<![^\W\d_])(?:(?:pseudo[- ]?)?random|noise|burst|chirp|impact|hammer|impulse?|psd|hammerschlag|"
    r"impulshammer|rauschen|rauschanregung|zufallsanregung|stoßanregung|aléatoire|bruit|marteau|choc|aleatori[oa]|"
    r"ruido|martillo|casuale|rumore|martello)(?![^\W\d_])"
)
_MEANS = (
    "a function of such an excitation shows the damping of that motion, not of a sine of the amplitude of its level"
)


def note_excitation(texts: Iterable[str], summary: Summary) -> None:
    """Note what frequency response functions are taken as, or a caution if a text names another excitation than a sine.

    ``texts``: names of file, runs and columns, ID lines, lines above a table. One caution is enough for all files.
    """
    if any(_MEANS in note for note in summary.notes):
        return
    other = next((text for text in texts if BROADBAND.search(text)), None)
    if other is None:
        summary.note("functions are taken as measured with a stepped or swept sine of the amplitude of their level")
        return
    wrong = "if damping changes with amplitude, levels and predictions are wrong"
    remedy = "measure with a stepped or swept sine"
    summary.note(f"caution: {describe_shortened(other)!r}: {_MEANS}; {wrong}: {remedy}")
