"""The same on a cluster of two workers, byte for byte."""

from __future__ import annotations

from functools import partial

import pytest
from reference.fleet_stand_in import arrive, content, made_fleet, said

from gearmon.errors import ArgumentError
from gearmon.fleet import on_dask, run_fleet
from gearmon.fleet.ledger import Outcome
from gearmon.fleet.run import _KILLED

dask, distributed = pytest.importorskip("dask"), pytest.importorskip("distributed")


@pytest.mark.filterwarnings("default")
def test_a_cluster_says_the_same_and_survives_a_recording_that_kills_workers(tmp_path):
    fleet = made_fleet(tmp_path)
    for day in range(24):
        text = "fault 0.2" if day % 5 == 0 else "0.1"
        arrive(tmp_path, "a_{}.txt", "kill" if day == 7 else text, days=day)
    known = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    patience = dask.config.set({"distributed.scheduler.allowed-failures": 1})
    with patience, distributed.LocalCluster(**known) as cluster:
        engine = partial(on_dask, task=said, scheduler=cluster.scheduler_address)
        run = run_fleet(fleet, engine)
    assert run.done == 23
    assert ["killed" in why for why in run.failed.values()] == [True]
    on_cluster = content(fleet)
    for path in tmp_path.glob("fleet.db*"):
        path.unlink()
    killer = next(iter(run.failed))

    def here(jobs):
        for job in jobs:
            yield Outcome(job=job, why=_KILLED) if job.path == killer else said(job)

    run_fleet(fleet, here)
    assert on_cluster == content(fleet)


@pytest.mark.filterwarnings("default")
def test_a_scheduler_that_does_not_answer_is_said(tmp_path, monkeypatch):
    fleet = made_fleet(tmp_path)
    arrive(tmp_path, "a_{}.txt", "0.1")
    monkeypatch.setattr("gearmon.fleet.run._CONNECT_S", 0.5)
    with pytest.raises(ArgumentError, match="run again to go on"):
        run_fleet(fleet, partial(on_dask, scheduler="tcp://127.0.0.1:9"))
