"""A campaign beside an earlier one: peaks against their predictions, and what has changed in modes and levels."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from damping.arrays import FloatArray, interpolate_logs
from damping.campaign.answer import Campaign
from damping.campaign.values import At, Bounds, Outcome

SAME_MODE = 0.05  #: modes of two campaigns are the same if their frequencies differ by less than this share
SAME_LEVEL = 0.01  #: levels of two campaigns are the same if they differ by less than this share
SHIFTED = 0.01  #: shift of a frequency, relative, that is reported at a level tested before: remounting shifts by less


@dataclass(frozen=True)
class EarlierCampaign:
    """What is known of an earlier campaign: the levels of each mode, with their peaks, by its frequency in Hz."""

    modes: Mapping[float, Sequence[At]]
    unit: str = ""  #: of levels; '' where it is not stated

    def find_mode(self, frequency: float) -> tuple[float, Sequence[At]]:
        """Frequency of the mode nearest to a frequency, and its levels; no levels if it is not the same mode."""
        nearest = min(self.modes, key=lambda other: abs(other / frequency - 1.0), default=np.inf)
        return nearest, self.modes[nearest] if abs(nearest / frequency - 1.0) < SAME_MODE else ()


def compare_predictions(before: EarlierCampaign, campaign: Campaign) -> tuple[Outcome, ...]:
    """Compare the peaks of every newly tested level with those that were predicted and tested before.

    Between levels a peak is interpolated linearly on logarithmic axes; outside there is no prediction.
    """
    predictions = []
    for mode in campaign.modes:
        near = before.find_mode(mode.frequency)[1]
        for at in (at for at in mode.places if at.tested and not _was_tested(near, at)):
            for response in at.response:
                known = _interpolate(_list_peaks(near, response.sensor, response.unit), at.input)
                if known is not None:
                    peak = (mode.name, response.sensor, response.unit, at.input, response.band.median)
                    predictions.append(Outcome(*peak, Bounds(*known), campaign.unit))
    return tuple(predictions)


def describe_changes(before: EarlierCampaign, campaign: Campaign) -> tuple[str, ...]:
    """A line for each mode at each new level, each changed level, and each mode or level without a counterpart."""
    if not before.modes:
        return ()
    lines: list[str] = []
    matched = set()
    for mode in campaign.modes:
        nearest, near = before.find_mode(mode.frequency)
        if not near:
            no = f"the earlier campaign has no mode within {100 * SAME_MODE:g} %, the nearest at {nearest:.4g} Hz"
            lines.append(f"{mode.name}, {mode.frequency:.4g} Hz: {no}")
            continue
        matched.add(nearest)
        for at in (at for at in mode.places if at.tested):
            lines += (f"{mode.name} at {at.input:.3g} {campaign.unit}{line}" for line in _describe_level(near, at))
    for frequency in sorted(before.modes.keys() - matched):
        lines.append(f"the mode of the earlier campaign at {frequency:.4g} Hz: none here within {100 * SAME_MODE:g} %")
    return tuple(lines) or ("every level was tested before, and frequency, damping and peaks are the same",)


def _describe_level(near: Sequence[At], at: At) -> Iterator[str]:
    """At most one line on frequency and damping beside those known; and on the peaks at a level tested before."""
    tested = _was_tested(near, at)
    modal = {earlier.input: (earlier.frequency, *earlier.ratio) for earlier in near if earlier.ratio}
    known = _interpolate(modal, at.input)
    if known is None:
        if _is_within({earlier.input for earlier in near}, at.input):
            yield ": the earlier campaign has no frequency and damping there"
        else:
            yield ": outside the levels of the earlier campaign, nothing to compare"
        return
    word = "then" if tested else "predicted"
    frequency, *ratio = known
    shift = at.frequency / frequency - 1.0
    parts = [f"{at.frequency:.5g} Hz ({frequency:.5g} {word}, {100 * shift:+z.1f} %)"]
    changed = abs(shift) > SHIFTED
    if at.ratio is not None:
        apart = _are_apart(at.ratio, ratio)
        changed |= apart
        median, low, high = (f"{100 * part:.3g}" for part in ratio)
        place = ", OUTSIDE" if apart else ""
        parts.append(f"damping {100 * at.ratio.median:.3g} % ({median}, {low} to {high} {word}{place})")
    for response in at.response if tested else ():
        peak = _interpolate(_list_peaks(near, response.sensor, response.unit), at.input)
        if peak is not None and _are_apart(response.band, peak):
            changed = True
            parts.append(f"{response.sensor} {20.0 * np.log10(response.band.median / peak[0]):+z.1f} dB")
    if changed or not tested:
        yield f"{', tested before, has changed' if tested else ''}: {'; '.join(parts)}"


def _was_tested(near: Sequence[At], at: At) -> bool:
    return any(earlier.tested and abs(earlier.input / at.input - 1.0) < SAME_LEVEL for earlier in near)


def _list_peaks(near: Sequence[At], sensor: str, unit: str) -> dict[float, Bounds]:
    """Peak of a sensor by level."""
    peaks = ((at.input, peak) for at in near for peak in at.response)
    return {level: peak.band for level, peak in peaks if (peak.sensor, peak.unit) == (sensor, unit)}


def _are_apart(band: Bounds, other: Iterable[float]) -> bool:
    """Whether two bands have nothing in common."""
    _, low, high = other
    return bool(band.low > high or band.high < low)


def _is_within(levels: Collection[float], level: float) -> bool:
    return bool(levels) and min(levels) * (1.0 - SAME_LEVEL) <= level <= max(levels) * (1.0 + SAME_LEVEL)


def _interpolate(rows: Mapping[float, Sequence[float]], level: float) -> FloatArray | None:
    """Values at a level at or between those of ``rows``, by level, on logarithmic axes; None outside, or if unknown."""
    if not _is_within(rows, level):
        return None
    known = np.array([rows[at] for at in sorted(rows)], dtype=np.float64)
    values = [interpolate_logs(level, sorted(rows), column) for column in known.T]
    return np.array(values) if np.isfinite(values).all() else None
