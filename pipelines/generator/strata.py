"""How many cases of which kind, and the seeds of development and of the blind run."""

from __future__ import annotations

from dataclasses import dataclass

from pipelines.generator.effects import LIBRARY, OUTSIDE

#: Seeds differ so that nothing chosen while developing has seen a blind case.
DEVELOPMENT_SEED = 20250
BLIND_SEED = 86400077
BLIND_CASES = 1500

NULLS = ("null:nothing", "null:parameters", "null:scatter")
PAIRS = ("pair:force-instrument", "pair:two-forces", "pair:force-structure")

#: Shares of the cases of a run; at 1500 cases 510 are null and each effect of the library has some 36.
SHARES = {"null": 0.34, "single": 0.36, "pair": 0.12, "outside": 0.18}
_KINDS = {"null": NULLS, "single": LIBRARY, "pair": PAIRS, "outside": OUTSIDE}


@dataclass(frozen=True)
class Stratum:
    """One case to draw: its kind and conditions."""

    kind: str
    field: bool


def strata(cases: int, kinds: tuple[str, ...] | None = None) -> list[Stratum]:
    """``cases`` strata, clean and field by turns within each kind; ``kinds`` alone in equal parts where given."""
    if kinds is not None:
        places = [divmod(n, len(kinds)) for n in range(cases)]
        return [Stratum(kinds[kind], (turn + kind) % 2 == 1) for turn, kind in places]
    plan: list[Stratum] = []
    left = cases
    for number, (family, share) in enumerate(SHARES.items()):
        count = left if number == len(SHARES) - 1 else min(left, round(share * cases))
        plan += strata(count, _KINDS[family])
        left -= count
    return plan
