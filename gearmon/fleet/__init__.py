"""Many machines: folders that are watched, a ledger, alarms, and who needs somebody today.

`read_fleet` reads the fleet file, `run_fleet` analyses what is new and `watch_fleet` what arrives;
everything is kept in one store, which `gearmon history` reads too.

Examples
--------
>>> from pathlib import Path
>>> from gearmon.fleet import Fleet, FleetMachine, Hook, Job, Run, acknowledge, alarms, deliver
>>> from gearmon.fleet import in_processes, on_dask, read_fleet, run_fleet, watch_fleet
>>> gears = '''
... [operating]
... speed_rpm = 1480.0
... torque_nm = 120.0
... [[stage]]
... kind = "parallel"
... pinion_teeth = 23
... gear_teeth = 57
... module_mm = 2.5
... face_width_mm = 28.0
... '''
>>> listed = '''
... [[machine]]
... name = "drive"
... file = "drive.toml"
... recordings = "inbox"
... pattern = "drive_(?P<time>[0-9T-]+).csv"
... [[alarm]]
... command = ["logger"]
... '''
>>> _ = Path("drive.toml").write_text(gears), Path("fleet.toml").write_text(listed)
>>> Path("inbox").mkdir()
>>> fleet = read_fleet("fleet.toml")
>>> isinstance(fleet, Fleet), isinstance(fleet.machine("drive"), FleetMachine)
(True, True)
>>> isinstance(fleet.hooks[0], Hook)
True
>>> run = run_fleet(fleet)   # nothing has arrived yet
>>> isinstance(run, Run), run.done, alarms(fleet), deliver(fleet)
(True, 0, [], [])
>>> watch_fleet(fleet, every_s=0.01, told=print, rounds=1)
>>> acknowledge(fleet, 1)    # the alarm with this id, once there is one
>>> job = Job(
...     path="inbox/drive_2026-03-01.csv", machine=fleet.machines[0], operating_class="",
...     time_s=1.77e9, size=4096, changed="0",
... )
>>> [outcome.job.size for outcome in in_processes([])]   # it takes jobs
[]
>>> callable(on_dask), job.state                          # so does this, with a scheduler
(True, (4096, '0'))
"""

from gearmon.lazy import lazily

_OFFERED = {
    "ledger": ("acknowledge", "alarms", "deliver"),
    "plan": ("Fleet", "FleetMachine", "Hook", "Job", "read_fleet"),
    "run": ("Run", "in_processes", "on_dask", "run_fleet", "watch_fleet"),
}
__all__, __getattr__ = lazily(__name__, _OFFERED)
