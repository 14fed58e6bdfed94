"""Script for another environment: mesh stiffness by ROSS, timed there, as lines of JSON.

It is run by path with that environment's interpreter and imports nothing of gearmon. The gears
come as JSON in the first argument; every line on standard input asks for one more timed run.
"""

from __future__ import annotations

import json
import os
import sys
import time
import warnings
from typing import Any

#: Contact positions of one mesh period.
POSITIONS = 1000


def main() -> None:
    """Answer with the gears and their stiffness first, then with one run time per line."""
    warnings.simplefilter("ignore")
    data = json.loads(sys.argv[1])
    # the library and its parts, some of them compiled, print on import
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    from importlib.metadata import version

    mesh = _mesh(data)
    first = {
        "version": version("ross-rotordynamics"),
        "elastic_modulus_pa": float(mesh.driving_gear.material.E),
        "poisson_ratio": float(mesh.driving_gear.material.Poisson),
        "contact_ratio": float(mesh.contact_ratio),
        "stiffness_n_per_m": [float(k) for k in mesh.stiffness_range],
        **_places(mesh),
    }
    print(json.dumps(first), file=answers, flush=True)
    for _ in sys.stdin:
        start = time.perf_counter()
        mesh.get_stiffness_for_mesh_period(n_mesh_period=1, n_points=POSITIONS)
        print(time.perf_counter() - start, file=answers, flush=True)


def _mesh(data: dict[str, Any]) -> Any:
    from ross.gear_element import GearElementTVMS, Mesh  # type: ignore[import-not-found]
    from ross.materials import steel  # type: ignore[import-not-found]

    one, two = (
        GearElementTVMS(
            n=number,
            material=steel,
            width=data["face_width_m"],
            bore_diameter=bore,
            module=data["module_m"],
            n_teeth=teeth,
            pr_angle=data["pressure_angle_rad"],
        )
        for number, (teeth, bore) in enumerate(zip(data["teeth"], data["bores_m"], strict=True))
    )
    return Mesh(one, two)


def _places(mesh: Any) -> dict[str, Any]:
    """Return where the first and the last position lie, as pressure angles of both gears."""
    one, two = mesh.driving_gear.pr_angles_dict, mesh.driven_gear.pr_angles_dict
    return {
        "pressure_angles_rad": [float(one["start_point"]), float(two["addendum"])],
        "step_rad": float(one["addendum"] - one["start_point"]) / float(mesh.contact_ratio),
        "gear_ratio": float(mesh.gear_ratio),
        "mesh_angles_rad": [float(angle) for angle in mesh.theta_range],
    }


if __name__ == "__main__":
    main()
