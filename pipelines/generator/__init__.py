"""Blind cases for the gap diagnosis: true structures integrated in time, measured by an imperfect rig.

This package shares no code with what diagnoses its cases: it imports numpy, scipy and itself alone.
"""

from pipelines.generator.case import Case, draw_case
from pipelines.generator.strata import Stratum, strata

__all__ = ["Case", "Stratum", "draw_case", "strata"]
