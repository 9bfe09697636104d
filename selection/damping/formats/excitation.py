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
#: What a text says if such a word in it is not of the excitation: a sine, or a quantity beside it.
_OTHER = re.compile(
    r"(?i)(?<![^\W\d_])(?:sine|sinus|stepped|swept|dwell|floor|seed|no random|(?:impact|hammer) (?:damper|absorber))"
    r"(?![^\W\d_])|noise\s*[=:\[(]?\s*[\d.]+\s*%|noise[\s_-](?:level|sd|of)"
    r"|(?:phase|accel\w*|amplitude|electrical|measurement)[\s_-]noise"
)
_SINE = "functions are taken as measured with a stepped or swept sine of the amplitude of their level"
_MEANS = (
    "a function of such an excitation shows the damping of that motion, not of a sine of the amplitude of its level"
)


def note_excitation(texts: Iterable[str], summary: Summary) -> None:
    """Note what frequency response functions are taken as, or a caution if a text names another excitation than a sine.

    ``texts``: names of file, runs and columns, ID lines, lines above a table. One caution is enough for all files.
    """
    if any(_MEANS in note for note in summary.notes):
        return
    other = next((text for text in texts if BROADBAND.search(text) and not _OTHER.search(text)), None)
    if other is None:
        if _SINE not in summary.notes:
            summary.note(_SINE)
        return
    if _SINE in summary.notes:  # of another file
        summary.notes.remove(_SINE)
    wrong = "if damping changes with amplitude, levels and predictions are wrong"
    remedy = "measure with a stepped or swept sine"
    summary.note(f"caution: {describe_shortened(other)!r}: {_MEANS}; {wrong}: {remedy}")
