"""All pictures of the study by name."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from matplotlib.figure import Figure

from gearmon.files import replacing
from gearmon.report import study_plots_energy, study_plots_forms, study_plots_sweeps
from gearmon.study.results import StudyResults

DPI = 110

DRAWINGS: dict[str, Callable[[StudyResults], Figure]] = {
    "stiffness_forms": study_plots_forms.stiffness_forms,
    "stiffness_form_spectra": study_plots_forms.stiffness_form_spectra,
    "form_responses": study_plots_forms.form_responses,
    "mesh_force": study_plots_forms.mesh_force,
    "orders": study_plots_forms.orders,
    "stiffness_from_rest": study_plots_sweeps.stiffness_from_rest,
    "stiffness_settled": study_plots_sweeps.stiffness_settled,
    "stiffness_spectra": study_plots_sweeps.stiffness_spectra,
    "stiffness_velocity_lines": study_plots_sweeps.stiffness_velocity_lines,
    "stiffness_acceleration_lines": study_plots_sweeps.stiffness_acceleration_lines,
    "mass_in_time": study_plots_sweeps.mass_in_time,
    "mass_separate": study_plots_sweeps.mass_separate,
    "mass_spectra": study_plots_sweeps.mass_spectra,
    "mass_lines": study_plots_sweeps.mass_lines,
    "damping_in_time": study_plots_sweeps.damping_in_time,
    "damping_separate": study_plots_sweeps.damping_separate,
    "damping_spectra": study_plots_sweeps.damping_spectra,
    "damping_lines": study_plots_sweeps.damping_lines,
    "energy_of_stiffness": study_plots_energy.energy_of_stiffness,
    "energy_of_mass": study_plots_energy.energy_of_mass,
    "energy_of_damping": study_plots_energy.energy_of_damping,
    "energy_of_reference": study_plots_energy.energy_of_reference,
    "contact": study_plots_energy.contact,
    "damage": study_plots_energy.damage,
    "speed": study_plots_energy.speed,
}


def save_picture(name: str, results: StudyResults, path: Path) -> None:
    """Draw one picture and write it as PNG.

    Parameters
    ----------
    name : str
        Key of `DRAWINGS`.
    results : StudyResults
    path : Path
        The file; its folder must exist.
    """
    with replacing(path) as temporary:
        DRAWINGS[name](results).savefig(temporary, dpi=DPI)
