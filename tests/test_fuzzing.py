"""Damaged and hostile files: a quick round of `fuzzing.py`, which runs longer by hand."""

from __future__ import annotations

import pytest
from fuzzing import FORMATS, attack, targets

# Every file of a reference that is read whole is also used.
TRIALS = {"csv": 80, "reference": 60, "kinds": 100, "history": 100, "ledger": 50}
# Libraries that read these do so in a process of its own.
TRIALS |= dict.fromkeys(("hdf5", "mat", "packed_mat"), 80)
NAMES = ("tables", "csv", "reference", "kinds", "history", "indicators", "machine")
NAMES += ("fleet", "ledger", "plan", "harvester")


@pytest.fixture(scope="module")
def known(tmp_path_factory):
    return targets(tmp_path_factory.mktemp("fuzzing"))


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", [*NAMES, *(write.__name__ for write in FORMATS)])
def test_damaged_files_are_read_as_they_were_or_refused_in_one_line(known, tmp_path, name):
    assert attack(known[name], TRIALS.get(name, 150), 0, tmp_path) == []
