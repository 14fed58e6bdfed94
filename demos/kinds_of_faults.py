"""Tell pitting, wear and eccentricity of a pinion apart.

Run it as it stands: python demos/kinds_of_faults.py
"""

from pathlib import Path

from gearmon.demos import run_demo


def main():
    result = run_demo("kinds", Path("gearmon-kinds"))
    print("\n".join(result.lines()))


if __name__ == "__main__":
    main()
