"""Proofs of errata as the reader sees them: the plain letters of the data in the symbols of the report."""

from __future__ import annotations

import re

_SUPERSCRIPT = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
#: What stands in the data, as a pattern, and what the report writes.
SYMBOLS = {
    r"->": "→",
    r"\+-": "±",
    r"(?<=[\w)\]])( ?)\*( ?)(?=[\w(.])": r"\1·\2",
    r"\b(?:Gamma)\b": "Γ",
    r"(?<![A-Za-z])pi(?![A-Za-z])": "π",
    r"(?<![A-Za-z])xi(?![A-Za-z])": "ξ",
    r"(?<![A-Za-z])phi(?![A-Za-z])": "φ",
    r"(?<![A-Za-z])eta(?![A-Za-z])": "η",
    r"(?<![A-Za-z])omega(?![A-Za-z])": "ω",
    r"(?<![A-Za-z])(?:w)(?![A-Za-z])": "ω",
    r"\bwt\b": "ωt",
    r"(?<![A-Za-z])psi(?![A-Za-z])": "ψ",
    r"(?<![A-Za-z])int(?=[ _])": "∫",
    r"\bLambda(?=_)": "Λ",
    r"\balpha\b": "α",
    r"\bbeta\b": "β",
    r"\bdelta\b": "δ",
    r"\bdW\b": "ΔW",
    r"\bQd\b": "Q̇",
    r"(?<=\d)pi": "π",
    r"\bOLS\b": "least squares",
    r"\bdof\b": "degree of freedom",
    r"\bs\.e\.": "standard error",
    r"\bsqrt\b": "√",
}


def in_symbols(text: str) -> str:
    """``2*pi*xi_1*w_n`` as 2·π·ξ_1·ω_n."""
    text = re.sub(r"\^(\d)(?![\d.])", lambda found: found[1].translate(_SUPERSCRIPT), text)
    for pattern, symbol in SYMBOLS.items():
        text = re.sub(pattern, symbol, text)
    return text
