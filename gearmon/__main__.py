"""Run the command line as `python -m gearmon`."""

from gearmon.cli import main

raise SystemExit(main())
