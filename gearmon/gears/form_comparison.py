"""The forms of the mesh stiffness side by side: curves over mesh periods, and their lines."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from gearmon.errors import ArgumentError, check_range
from gearmon.gears.mechanics import stage_mechanics
from gearmon.gears.pairs import mesh_pairs
from gearmon.gears.panels import ComplexArray, FloatArray
from gearmon.gears.potential_energy import PotentialEnergy
from gearmon.gears.stiffness import MeshStiffness, pair_stiffness
from gearmon.gears.stiffness_forms import StiffnessForm

#: The four forms, each with its variants: the duty of the rectangle is eps_a - 1, or one half.
FOUR_FORMS: dict[str, tuple[str, ...]] = {
    "parabolic": ("parabolic",),
    "wave": ("wave",),
    "rectangular": ("rectangular", "rectangular-half"),
    "fourier": ("fourier-true", "fourier"),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class FormCurve:
    """One form of the stiffness of a mesh.

    Parameters
    ----------
    group, name : str
        The form, and the variant of it.
    stiffness : MeshStiffness
    stiffness_n_per_m : ndarray, shape (p,)
        At the phases of the comparison [N/m].
    lines : complex ndarray, shape (n,)
        c_1 ... c_n of ``k = mean (1 + sum_n (c_n exp(2 pi i n phase) + conj))``.
    """

    group: str
    name: str
    stiffness: MeshStiffness
    stiffness_n_per_m: FloatArray
    lines: ComplexArray

    @property
    def amplitudes_n_per_m(self) -> FloatArray:
        """Amplitudes 2 |c_n| mean of the mesh harmonics [N/m]."""
        return np.asarray(2 * np.abs(self.lines) * self.stiffness.healthy_mean_n_per_m)


@dataclass(frozen=True, kw_only=True, eq=False)
class FormComparison:
    """Forms of the stiffness of one mesh side by side.

    Parameters
    ----------
    machine : str
    stage : int
    mesh : str
    mesh_frequency_hz : float or None
        None where the machine has no operating point.
    phase : ndarray, shape (p,)
        [mesh periods].
    curves : tuple of FormCurve
    """

    machine: str
    stage: int
    mesh: str
    mesh_frequency_hz: float | None
    phase: FloatArray
    curves: tuple[FormCurve, ...]

    @property
    def contact_ratio(self) -> float:
        """Transverse contact ratio."""
        return self.curves[0].stiffness.contact_ratio

    def rows(self) -> list[dict[str, Any]]:
        """Return the curves: one row a phase, one column a form, in N/m."""
        columns = {_column(curve.name): curve.stiffness_n_per_m for curve in self.curves}
        return [
            {"stage": self.stage, "mesh_phase": float(phase)}
            | {name: float(values[i]) for name, values in columns.items()}
            for i, phase in enumerate(self.phase)
        ]

    def line_rows(self) -> list[dict[str, Any]]:
        """Return the spectra: one row a mesh harmonic, amplitudes in N/m."""
        count = len(self.curves[0].lines)
        hertz = self.mesh_frequency_hz
        return [
            {"stage": self.stage, "mesh_harmonic": n + 1}
            | ({} if hertz is None else {"frequency_hz": (n + 1) * hertz})
            | {_column(curve.name): float(curve.amplitudes_n_per_m[n]) for curve in self.curves}
            for n in range(count)
        ]

    def to_dict(self) -> dict[str, Any]:
        """Return everything in built-in types."""
        return {
            "machine": self.machine,
            "stage": self.stage,
            "mesh": self.mesh,
            "contact_ratio": self.contact_ratio,
            "overlap_ratio": self.curves[0].stiffness.overlap_ratio,
            "forms": [
                {
                    "form": curve.name,
                    "mean_stiffness_n_per_m": curve.stiffness.healthy_mean_n_per_m,
                    "stiffness_variation": curve.stiffness.variation,
                }
                for curve in self.curves
            ],
            "table": self.rows(),
            "spectrum": self.line_rows(),
        }


def compare_forms(
    machine: Any,
    stage: int = 1,
    *,
    forms: Iterable[tuple[str, str | StiffnessForm | PotentialEnergy]] | None = None,
    mesh_periods: int = 2,
    points_per_mesh: int = 200,
    harmonics: int = 20,
) -> FormComparison:
    """Return the four forms of the stiffness of a healthy mesh side by side, with their spectra.

    Parameters
    ----------
    machine : Machine
    stage : int
        Counted from 1; of a planetary stage its sun-planet mesh.
    forms : iterable of (str, form), optional
        Group and form of each curve; by default `FOUR_FORMS`.
    mesh_periods : int, 1 to 100
    points_per_mesh : int, 2 to 100,000
    harmonics : int, 1 to 10,000
        Mesh harmonics of the spectra, exact and none aliased.

    Returns
    -------
    FormComparison

    Raises
    ------
    ArgumentError
        If the machine lacks data, or a form or number has no meaning.
    """
    check_range("stage", stage, 1, len(machine.stages))
    check_range("mesh_periods", mesh_periods, 1, 100)
    check_range("points_per_mesh", points_per_mesh, 2, 100_000)
    check_range("harmonics", harmonics, 1, 10_000)
    wanted = _wanted() if forms is None else list(forms)
    if not wanted:
        raise ArgumentError("forms: at least one form must be given")
    pair = mesh_pairs(machine.stages[stage - 1], stage, machine.path)[0]
    force, hertz = _running(machine, stage)
    phase = np.arange(mesh_periods * points_per_mesh + 1) / points_per_mesh
    orders = np.arange(1, harmonics + 1)
    curves = []
    for group, form in wanted:
        stiffness = pair_stiffness(pair, (), form, force_n=force)
        curves.append(
            FormCurve(
                group=group,
                name=form if isinstance(form, str) else form.name,
                stiffness=stiffness,
                stiffness_n_per_m=stiffness.at(phase),
                lines=stiffness.healthy.coefficients(orders) / stiffness.healthy_mean_n_per_m,
            )
        )
    return FormComparison(
        machine=machine.name,
        stage=stage,
        mesh=pair.name,
        mesh_frequency_hz=hertz,
        phase=phase,
        curves=tuple(curves),
    )


def _wanted() -> list[tuple[str, str | StiffnessForm | PotentialEnergy]]:
    return [(group, name) for group, names in FOUR_FORMS.items() for name in names]


def _running(machine: Any, stage: int) -> tuple[float | None, float | None]:
    """Return static tooth force and mesh frequency where they are known."""
    try:
        mechanics = stage_mechanics(machine, stage)
    except ArgumentError:
        return None, None
    return mechanics.force_n, mechanics.mesh_frequency_hz


def _column(name: str) -> str:
    return f"{name.replace('-', '_')}_n_per_m"
