"""Unit constants with their sources."""

from __future__ import annotations

from math import pi

#: Acceleration of gravity that the report divides by (section 3.1, "multiplying by 386"), in/s^2.
STANDARD_GRAVITY_REPORT_IN_S2 = 386.0
#: Standard acceleration of gravity, ISO 80000-3, m/s^2.
STANDARD_GRAVITY_M_S2 = 9.80665
#: International inch (1959 agreement), m.
INCH_M = 0.0254
#: International avoirdupois pound-force (pound 0.45359237 kg times standard gravity), N.
POUND_FORCE_N = 0.45359237 * STANDARD_GRAVITY_M_S2
#: Cycles per second to radians per second.
RAD_S_PER_HZ = 2.0 * pi
