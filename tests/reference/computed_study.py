"""The published study, computed once for all tests that need it."""

from functools import lru_cache

from gearmon.study import StudyResults, run_study

#: What it told of its progress.
SHARES: list[float] = []


@lru_cache(maxsize=1)
def computed_study() -> StudyResults:
    """The study with coarser scans and fewer run times."""
    return run_study(SHARES.append, quick=True)
