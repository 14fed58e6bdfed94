"""Script for another environment: the kurtogram of PySDKit, timed there, as lines of JSON.

It is run by path with that environment's interpreter and imports nothing of gearmon. Samples and
levels come in the arguments; every line on standard input asks for one more timed run.
"""

from __future__ import annotations

import json
import os
import sys
import time
import warnings


def main() -> None:
    """Answer with the version first, then with one run time per line."""
    warnings.simplefilter("ignore")
    count, levels = int(sys.argv[1]), int(sys.argv[2])
    # libraries print on import
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    os.environ.setdefault("MPLBACKEND", "agg")
    from importlib import import_module
    from importlib.metadata import version

    import numpy as np

    fast_kurtogram = import_module("pysdkit.utils._kurtogram").fast_kurtogram
    samples = np.random.default_rng(0).normal(size=count)
    fast_kurtogram(samples, levels, 1.0)
    print(json.dumps({"version": version("PySDKit")}), file=answers, flush=True)
    for _ in sys.stdin:
        start = time.perf_counter()
        fast_kurtogram(samples, levels, 1.0)
        print(json.dumps(time.perf_counter() - start), file=answers, flush=True)


if __name__ == "__main__":
    main()
