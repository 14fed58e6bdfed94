"""Bounds of random systems against one matrix of all lines, as many as wanted.

By hand; some run with the tests (`test_system.py`):

    python tests/dynamics/many_systems.py --count 2000
"""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from reference.system_reference import lines_at_once, random_system, relative

from gearmon.dynamics import steady_state

# What one matrix leaves to rounding.
ROUNDING = 1e-11


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=2026)
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    unstable = refused = broken = 0
    nearest = 0.0
    for number in range(arguments.count):
        system = random_system(rng, 40, 12, 6, rng.choice([0.2, 0.4, 0.8]))
        tolerance = (1e-6, 1e-9)[number % 2]
        found = steady_state(system, tolerance)
        unstable += not found.stable
        refused += found.stable and not found.error_bound <= tolerance
        if found.stable and math.isfinite(found.error_bound):
            exact = lines_at_once(system, len(found.displacement) + 7)
            share = relative(exact, found) / (found.error_bound + ROUNDING)
            broken += share > 1
            nearest = max(nearest, share)
    print(
        f"{arguments.count} systems, 3 to 40 coordinates, 2 to 12 meshes: {unstable} unstable, of "
        f"the others {refused} above the tolerance; {broken} bounds broken, true error at most "
        f"{nearest:.3f} of its bound"
    )
    return int(broken > 0)


if __name__ == "__main__":
    sys.exit(main())
