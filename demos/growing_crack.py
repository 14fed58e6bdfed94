"""Follow a crack that grows on a pinion tooth over twenty recordings until it is flagged.

Run it as it stands: python demos/growing_crack.py
"""

from pathlib import Path

from gearmon.demos import run_demo


def main():
    result = run_demo("growth", Path("gearmon-growth"))
    print("\n".join(result.lines()))


if __name__ == "__main__":
    main()
