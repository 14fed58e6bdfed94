"""One function a command: arguments -> one call -> output and exit code.

Everything heavy is imported inside the function that needs it.

Examples
--------
>>> from gearmon.commands import COMMANDS, Command
>>> isinstance(COMMANDS[0], Command), [command.name for command in COMMANDS[:4]]
(True, ['init', 'lines', 'stiffness', 'baseline'])
"""

from gearmon.commands import fleet, machines, recordings, setup, signals
from gearmon.commands.command import Command

#: All commands, in the order of a first use.
COMMANDS = (
    setup.init,
    *(machines.lines, machines.stiffness, machines.baseline, machines.family),
    *(machines.stability, machines.modes, machines.simulate),
    *(recordings.learn, setup.check, recordings.analyse, recordings.kinds, recordings.history),
    fleet.fleet,
    *(signals.indicators, signals.spectrum, signals.orders),
    *(machines.harvest, signals.exposure, setup.demo, setup.benchmark),
)

__all__ = ["COMMANDS", "Command"]
