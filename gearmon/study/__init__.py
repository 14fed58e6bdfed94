"""A published study of a gear pair, computed anew and held against what it claims.

One pair (26 and 53 teeth, contact ratio 1.412) is driven through four forms of mesh stiffness and
through sweeps of stiffness, mass and damping. `run_study` computes everything, `judge` holds the
results against the claims of study.toml, one by one, and `write_study` writes page, pictures and
tables to a folder.

>>> from gearmon.study import CLAIMS
>>> CLAIMS[1].text
'The gear data and the model parameters describe one pair.'
"""

from gearmon.study.claims import CLAIMS, judge
from gearmon.study.experiments import StudyResults, run_study
from gearmon.study.report import write_study

__all__ = ["CLAIMS", "StudyResults", "judge", "run_study", "write_study"]
