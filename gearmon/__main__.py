# PYTHON_ARGCOMPLETE_OK
"""Run the command line: `gearmon`, or `python -m gearmon`."""

import sys
import warnings


def run() -> int:
    """Run the command line as a process: nothing but its own lines reaches the terminal.

    Returns
    -------
    int
        Exit code.
    """
    if not sys.warnoptions:
        warnings.simplefilter("ignore")  # those of libraries; ours are sentences of the result
    try:
        from gearmon.cli import main  # takes a moment, in which somebody may press Ctrl-C

        return main()
    except KeyboardInterrupt:
        return 130


if __name__ == "__main__":
    raise SystemExit(run())
