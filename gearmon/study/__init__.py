"""A published study of a gear pair, computed anew and held against what it claims.

One pair (26 and 53 teeth, contact ratio 1.412) is driven through four forms of mesh stiffness and
through sweeps of stiffness, mass and damping. `run_study` computes everything, `judge` holds the
results against the claims, one by one. Nothing here draws.
"""

from gearmon.study.claims import CLAIMS, judge
from gearmon.study.results import StudyResults, run_study

__all__ = ["CLAIMS", "StudyResults", "judge", "run_study"]
