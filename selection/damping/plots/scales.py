"""Marks of logarithmic axes."""

import numpy as np
from matplotlib.axis import Axis
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator

#: Marks of a logarithmic axis in a decade: the first of these that gives ``LEAST_MARKS`` on it.
_MARKS = ((1.0,), (1.0, 3.0), (1.0, 2.0, 5.0))
LEAST_MARKS = 3  #: two marks do not show that an axis is logarithmic


def plain_log(axis: Axis) -> None:
    """Label a logarithmic axis with plain numbers: decades, or more where it has few; round ones on a short axis."""
    low, high = sorted(axis.get_view_interval())
    decades = 10.0 ** np.arange(np.floor(np.log10(low)), np.log10(high) + 1.0)
    marks = {subs: np.outer(decades, subs) for subs in _MARKS}
    subs = next((subs for subs, own in marks.items() if np.sum((low <= own) & (own <= high)) >= LEAST_MARKS), None)
    axis.set_major_locator(LogLocator(subs=subs, numticks=7) if subs else MaxNLocator(LEAST_MARKS))
    axis.set_major_formatter(lambda value, position: f"{value:.0f}" if value >= 1000.0 else f"{value:g}")
    axis.set_minor_locator(NullLocator())
