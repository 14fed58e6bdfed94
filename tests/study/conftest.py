"""The study is computed once; judging it is quick."""

from __future__ import annotations

import pytest
from reference.computed_study import computed_study

from gearmon.study import judge


@pytest.fixture(scope="session")
def results():
    return computed_study()


@pytest.fixture(scope="session")
def findings(results):
    return {entry.claim.key: entry for entry in judge(results)}
