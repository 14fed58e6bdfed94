"""One function a command: arguments -> one call -> output and exit code.

Everything heavy is imported inside the function that needs it.

Examples
--------
>>> from gearmon.commands import COMMANDS, Command
>>> isinstance(COMMANDS[0], Command), [command.name for command in COMMANDS[:4]]
(True, ['init', 'lines', 'stiffness', 'baseline'])
"""

from gearmon.commands.command import Command
from gearmon.commands.exposure import EXPOSURE
from gearmon.commands.fleet import FLEET
from gearmon.commands.machines import (
    BASELINE,
    FAMILY,
    HARVEST,
    LINES,
    MODES,
    SIMULATE,
    STABILITY,
    STIFFNESS,
)
from gearmon.commands.recordings import ANALYSE, HISTORY, KINDS, LEARN
from gearmon.commands.setup import CHECK, INIT
from gearmon.commands.signals import INDICATORS, ORDERS, SPECTRUM
from gearmon.commands.trials import BENCHMARK, DEMO

#: All commands, in the order of a first use.
COMMANDS = (
    INIT,
    LINES,
    STIFFNESS,
    BASELINE,
    FAMILY,
    STABILITY,
    MODES,
    SIMULATE,
    LEARN,
    CHECK,
    ANALYSE,
    KINDS,
    HISTORY,
    FLEET,
    INDICATORS,
    SPECTRUM,
    ORDERS,
    HARVEST,
    EXPOSURE,
    DEMO,
    BENCHMARK,
)

__all__ = ["COMMANDS", "Command"]
