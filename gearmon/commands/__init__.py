"""One function a command: arguments -> one call -> output and exit code.

`gearmon.cli` lists them. Everything heavy is imported inside the function that needs it. What a
terminal shows of longer answers stands in templates beside them, by the name of the command.

Examples
--------
>>> from gearmon.commands import Command
>>> from gearmon.commands.machines import lines
>>> isinstance(lines, Command), lines.example
(True, 'gearmon lines machine.toml')
"""

from gearmon.commands.command import Command

__all__ = ["Command"]
