"""Script for another environment: a competitor's task, timed there, as lines of JSON.

It is run by path with that environment's interpreter and imports nothing of gearmon. The name of
the task and its data, as JSON, come in the arguments; the first answer tells what is known, and
every line on standard input asks for one more timed run.
"""

from __future__ import annotations

import json
import os
import sys
import time
import warnings
from collections.abc import Callable
from importlib import import_module
from typing import Any

#: What is known, and the task to be timed.
Prepared = tuple[dict[str, Any], Callable[[], Any]]


def main() -> None:
    """Answer with what is known first, then with one run time per line."""
    warnings.simplefilter("ignore")
    # the libraries and their parts, some of them compiled, print on import
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    os.environ.setdefault("MPLBACKEND", "agg")
    known, task = {"ross": _ross, "pysdkit": _pysdkit}[sys.argv[1]](json.loads(sys.argv[2]))
    print(json.dumps(known), file=answers, flush=True)
    for _ in sys.stdin:
        start = time.perf_counter()
        task()
        print(time.perf_counter() - start, file=answers, flush=True)


def _version(package: str) -> str:
    from importlib.metadata import version

    return version(package)


def _ross(data: dict[str, Any]) -> Prepared:
    """Mesh stiffness of a pair; where the first and the last position lie, as pressure angles."""
    gear_element, steel = import_module("ross.gear_element"), import_module("ross.materials").steel
    shared = {"material": steel, "width": data["face_width_m"], "module": data["module_m"]}
    shared["pr_angle"] = data["pressure_angle_rad"]
    pairs = zip(data["teeth"], data["bores_m"], strict=True)
    gears = [
        gear_element.GearElementTVMS(n=n, n_teeth=teeth, bore_diameter=bore, **shared)
        for n, (teeth, bore) in enumerate(pairs)
    ]
    mesh = gear_element.Mesh(*gears)
    one, two = mesh.driving_gear.pr_angles_dict, mesh.driven_gear.pr_angles_dict
    known = {
        "version": _version("ross-rotordynamics"),
        "elastic_modulus_pa": float(mesh.driving_gear.material.E),
        "poisson_ratio": float(mesh.driving_gear.material.Poisson),
        "contact_ratio": float(mesh.contact_ratio),
        "stiffness_n_per_m": [float(k) for k in mesh.stiffness_range],
        "pressure_angles_rad": [float(one["start_point"]), float(two["addendum"])],
        "step_rad": float(one["addendum"] - one["start_point"]) / float(mesh.contact_ratio),
        "gear_ratio": float(mesh.gear_ratio),
        "mesh_angles_rad": [float(angle) for angle in mesh.theta_range],
    }
    return known, lambda: mesh.get_stiffness_for_mesh_period(
        n_mesh_period=1, n_points=data["positions"]
    )


def _pysdkit(data: dict[str, Any]) -> Prepared:
    """Kurtogram of noise."""
    import numpy as np

    fast_kurtogram = import_module("pysdkit.utils._kurtogram").fast_kurtogram
    samples = np.random.default_rng(0).normal(size=data["count"])
    fast_kurtogram(samples, data["levels"], 1.0)
    known = {"version": _version("PySDKit")}
    return known, lambda: fast_kurtogram(samples, data["levels"], 1.0)


if __name__ == "__main__":
    main()
