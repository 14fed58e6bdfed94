"""One function a command: arguments -> one call -> output and exit code.

Everything heavy is imported inside the command that needs it.
"""

from gearmon.commands.harvest import run_harvest
from gearmon.commands.machines import (
    run_baseline,
    run_lines,
    run_simulate,
    run_stability,
    run_stiffness,
)
from gearmon.commands.names import check_names
from gearmon.commands.output import BAD_INPUT, DONE, FLAGGED
from gearmon.commands.recordings import run_analyse, run_learn
from gearmon.commands.signals import run_indicators, run_orders, run_spectrum
from gearmon.commands.trials import run_benchmark, run_demo

__all__ = [
    "BAD_INPUT",
    "DONE",
    "FLAGGED",
    "check_names",
    "run_analyse",
    "run_baseline",
    "run_benchmark",
    "run_demo",
    "run_harvest",
    "run_indicators",
    "run_learn",
    "run_lines",
    "run_orders",
    "run_simulate",
    "run_spectrum",
    "run_stability",
    "run_stiffness",
]
