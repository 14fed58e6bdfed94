"""All claims of the study, and holding them against results."""

from __future__ import annotations

from gearmon.study.claims_damping import DAMPING_CLAIMS
from gearmon.study.claims_expansion import EXPANSION_CLAIMS
from gearmon.study.claims_forms import FORM_CLAIMS
from gearmon.study.claims_stiffness_mass import SWEEP_CLAIMS
from gearmon.study.claims_use import USE_CLAIMS
from gearmon.study.findings import Claim, Judged
from gearmon.study.results import StudyResults

#: In the order of the study.
CLAIMS: tuple[Claim, ...] = (
    *FORM_CLAIMS,
    *EXPANSION_CLAIMS,
    *SWEEP_CLAIMS,
    *DAMPING_CLAIMS,
    *USE_CLAIMS,
)


def judge(results: StudyResults) -> tuple[Judged, ...]:
    """Hold every claim against the results.

    Parameters
    ----------
    results : StudyResults

    Returns
    -------
    tuple of Judged
        In the order of `CLAIMS`; every number is computed from the results.
    """
    return tuple(Judged(claim=claim, finding=claim.evaluate(results)) for claim in CLAIMS)
