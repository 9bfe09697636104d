"""Names of array types used in signatures.

Unit constants with their sources.
"""

from __future__ import annotations

from math import pi
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

FloatArray: TypeAlias = npt.NDArray[np.float64]
ComplexArray: TypeAlias = npt.NDArray[np.complex128]
IntArray: TypeAlias = npt.NDArray[np.int64]
BoolArray: TypeAlias = npt.NDArray[np.bool_]
#: A number or an array of numbers that broadcasts with the others of the call.
Floats: TypeAlias = float | FloatArray


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
