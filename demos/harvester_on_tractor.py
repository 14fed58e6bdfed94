"""Place and tune a vibration energy harvester on a tractor's power take-off.

Run it as it stands: python demos/harvester_on_tractor.py
"""

from pathlib import Path

from gearmon.demos import run_demo


def main():
    result = run_demo("harvest", Path("gearmon-harvest"))
    print("\n".join(result.lines()))


if __name__ == "__main__":
    main()
