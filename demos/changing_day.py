"""Run a sound machine through a day of changing load and speed, and count the false alarms.

Run it as it stands: python demos/changing_day.py
"""

from pathlib import Path

from gearmon.demos import run_demo


def main():
    result = run_demo("day", Path("gearmon-day"))
    print("\n".join(result.lines()))


if __name__ == "__main__":
    main()
