"""The published study, computed once for all tests that need it."""

from functools import lru_cache

from gearmon.study import StudyResults, run_study


@lru_cache(maxsize=1)
def computed_study() -> StudyResults:
    """The study with coarser scans and fewer run times."""
    return run_study(quick=True)
