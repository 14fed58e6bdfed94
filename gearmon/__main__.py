# PYTHON_ARGCOMPLETE_OK
"""Run the command line: `gearmon`, or `python -m gearmon`."""

import signal
import sys
from contextlib import suppress

TYPE_CHECKING = False  # what is loaded here takes a moment, in which nobody hears Ctrl-C
if TYPE_CHECKING:
    from typing import NoReturn


def run() -> int:
    """Run the command line as a process: nothing but its own lines reaches the terminal.

    Whoever is told to stop takes his temporary files away first; of SIGTERM he then dies, as who
    sent it expects.

    Returns
    -------
    int
        Exit code.
    """
    stopped: list[int] = []

    def stop(number: int, _: object) -> "NoReturn":
        stopped.append(number)
        raise KeyboardInterrupt

    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) != signal.SIG_IGN:  # it is where nobody can press Ctrl-C
            signal.signal(number, stop)
    try:
        import warnings

        if not sys.warnoptions:
            warnings.simplefilter("ignore")  # those of libraries; ours are sentences of the result
        from gearmon.cli import main  # takes a moment, in which somebody may press Ctrl-C

        return main()
    except KeyboardInterrupt:
        with suppress(OSError):
            print("gearmon: stopped", file=sys.stderr)
        return 130
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # what is ending need not be stopped
        if signal.SIGTERM in stopped:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
            signal.raise_signal(signal.SIGTERM)


if __name__ == "__main__":
    raise SystemExit(run())
