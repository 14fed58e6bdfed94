"""From evidence to a verdict: strengths, their calibration, coverage, flags and words.

>>> from gearmon.diagnosis.decision import LIMITS
>>> LIMITS.must_notice
0.4
"""

from gearmon.diagnosis.decision.evidence import Decision, Evidence, decide
from gearmon.diagnosis.decision.thresholds import LIMITS, Limits

__all__ = ["LIMITS", "Decision", "Evidence", "Limits", "decide"]
