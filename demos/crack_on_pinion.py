"""Simulate a healthy and a cracked gearbox, learn, analyse and write the report.

Run it as it stands: python demos/crack_on_pinion.py
"""

from pathlib import Path

from gearmon.demos import run_demo


def main():
    result = run_demo("crack", Path("gearmon-demo"))
    print("\n".join(result.lines()))


if __name__ == "__main__":
    main()
