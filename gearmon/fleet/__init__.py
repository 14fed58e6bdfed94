"""Many machines: folders that are watched, a ledger, alarms, and who needs somebody today.

`read_fleet` reads the fleet file, `run_fleet` analyses what is new and `watch_fleet` what arrives;
everything is kept in one store, which `gearmon history` reads too. ::

    fleet = read_fleet("fleet.toml")
    run = run_fleet(fleet)
    for alarm in alarms(fleet):
        print(alarm["machine"], alarm["finding"], alarm["since"])
"""

from gearmon.fleet.alarm import acknowledge, alarms, deliver
from gearmon.fleet.engines import in_processes, on_dask
from gearmon.fleet.plan import Fleet, FleetMachine, Hook, Job, read_fleet
from gearmon.fleet.run import Run, run_fleet, watch_fleet

__all__ = [
    "Fleet",
    "FleetMachine",
    "Hook",
    "Job",
    "Run",
    "acknowledge",
    "alarms",
    "deliver",
    "in_processes",
    "on_dask",
    "read_fleet",
    "run_fleet",
    "watch_fleet",
]
