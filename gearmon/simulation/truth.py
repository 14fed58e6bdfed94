"""What is true of a simulated recording, for those who judge what was found in it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearmon import __version__
from gearmon.gears.faults import Fault
from gearmon.gears.kinematics import kinematics
from gearmon.machine import Machine, OperatingPoint
from gearmon.simulation.contact import Drive, ToothMesh
from gearmon.simulation.settings import Settings
from gearmon.simulation.train import Train

FloatArray = NDArray[np.float64]

MODEL = (
    "equations of motion integrated in time: gears as discs, every tooth pair with its own "
    "parabolic stiffness, damage and pitch deviation, meshes that cannot pull but meet their "
    "opposite flanks beyond the backlash, runout of the gears, stages coupled by the torsion of "
    "the shafts between them; mesh forces heard through random modes of the housing; without "
    "friction, profile relief and yielding bearings"
)
#: Disagreement of chunks above which the motion is called irregular.
IRREGULAR = 1e-3


@dataclass(frozen=True, kw_only=True, eq=False)
class Integration:
    """How the equations of motion were integrated.

    Parameters
    ----------
    longest_step_s : float
        [s].
    steps : int
    joint_mismatch : float
        Largest disagreement where chunks join, relative to the static deformation.
    frequencies_hz : ndarray
        Natural frequencies of the train at the greatest mesh stiffnesses [Hz].
    """

    longest_step_s: float
    steps: int
    joint_mismatch: float
    frequencies_hz: FloatArray


def make_truth(
    machine: Machine,
    faults: tuple[Fault, ...],
    settings: Settings,
    point: OperatingPoint,
    train: Train,
    drive: Drive,
    integration: Integration,
) -> dict[str, Any]:
    """Return all that is known of a simulated recording, in built-in types.

    Returns
    -------
    dict
        Ready for JSON. Tooth j of a gear with z teeth enters contact whenever the mesh phase is
        j - 1 modulo z; shaft 1 passes a whole turn at each of ``speed.turn_times_s``.
    """
    speed = _speed(settings, point, drive)
    return {
        "kind": "truth of a simulated recording",
        "gearmon_version": __version__,
        "numpy_version": np.__version__,
        "model": MODEL,
        "machine": machine.name,
        "machine_file": Path(machine.path).name,
        "machine_seed": settings.machine_seed,
        "recording_seed": settings.recording_seed,
        "sampling_rate_hz": settings.sampling_rate_hz,
        "duration_s": settings.samples / settings.sampling_rate_hz,
        "samples": settings.samples,
        "channels": settings.channels,
        "tacho_shaft": settings.tacho_shaft,
        "snr_db": settings.snr_db,
        "accuracy_grade": settings.accuracy_grade,
        "condition": "fault" if any(_acts(fault) for fault in faults) else "healthy",
        "faults": [_fault(fault) for fault in faults],
        "speed": speed,
        "load": _load(settings, point, drive),
        "shafts": [
            {"shaft": s.number, "order": s.order, "mean_hz": s.order * speed["mean_hz"]}
            for s in kinematics(machine).shafts
        ],
        "mesh": [
            {
                "stage": mesh.stage,
                "order": mesh.order,
                "frequency_hz": mesh.order * speed["mean_hz"],
            }
            for mesh in kinematics(machine).meshes
        ],
        "meshes": [_mesh(train, drive, number) for number in range(len(train.meshes))],
        "natural_frequencies_hz": integration.frequencies_hz.tolist(),
        "integration": {
            "longest_step_s": integration.longest_step_s,
            "steps": integration.steps,
            "joint_mismatch": integration.joint_mismatch,
        },
        "notes": [*train.notes, *_remarks(integration, train)],
    }


def _acts(fault: Fault) -> bool:
    """Whether a fault changes anything: one given as a loss of nothing does not."""
    return not fault.is_loss or fault.loss > 0


def _fault(fault: Fault) -> dict[str, Any]:
    return {
        "fault": str(fault),
        "kind": fault.kind,
        "stage": fault.stage,
        "gear": fault.gear,
        "tooth": fault.tooth,
        "stiffness_loss": fault.loss if fault.is_loss else None,
        "size": str(fault).rsplit(":", 1)[-1],
    }


def _speed(settings: Settings, point: OperatingPoint, drive: Drive) -> dict[str, Any]:
    motion = drive.motion
    times = np.linspace(0.0, settings.samples / settings.sampling_rate_hz, 4097)
    speed = motion.speed_hz(times)
    first, last = motion.turns(times[[0, -1]])
    return {
        "shaft": 1,
        "nominal_hz": point.shaft1_hz,
        "mean_hz": float((last - first) / times[-1]),
        "min_hz": float(speed.min()),
        "max_hz": float(speed.max()),
        "start_turns": motion.start_turns,
        "turn_times_s": np.round(
            motion.times_s(np.arange(np.ceil(first), np.floor(last) + 1)), 9
        ).tolist(),
    }


def _load(settings: Settings, point: OperatingPoint, drive: Drive) -> dict[str, Any]:
    times = np.linspace(0.0, settings.samples / settings.sampling_rate_hz, 4097)
    wander = settings.load * (1 + drive.load.value(times))
    return {
        "nominal_torque_nm": point.torque_nm,
        "mean_share": float(wander.mean()),
        "min_share": float(wander.min()),
        "max_share": float(wander.max()),
    }


def _mesh(train: Train, drive: Drive, number: int) -> dict[str, Any]:
    mesh, mechanics = train.meshes[number], train.mechanics[number]
    stiffness = mechanics.stiffness
    return {
        "stage": mesh.stage,
        "mesh": mesh.name,
        "teeth": list(mesh.teeth),
        "phase_at_start": float(mesh.phase(np.array([drive.motion.start_turns]))[0]),
        "force_n": mechanics.force_n,
        "mean_stiffness_n_per_m": stiffness.healthy_mean_n_per_m,
        "equivalent_mass_kg": mechanics.equivalent_mass_kg,
        "damping_ns_per_m": mechanics.damping_ns_per_m,
        "contact_ratio": stiffness.contact_ratio,
        "overlap_ratio": stiffness.overlap_ratio,
        "backlash_m": mesh.backlash_m,
        "errors": _errors(mesh),
    }


def _errors(mesh: ToothMesh) -> list[dict[str, Any]]:
    return [
        {
            "eccentricity_m": errors.eccentricity_m,
            "eccentricity_phase_rad": errors.eccentricity_phase_rad,
            "pitch_m": np.round(errors.pitch_m, 12).tolist(),
        }
        for errors in mesh.errors
    ]


def _remarks(integration: Integration, train: Train) -> list[str]:
    remarks = [warning for m in train.mechanics for warning in m.warnings]
    if integration.joint_mismatch > IRREGULAR:
        remarks.append(
            "irregular motion with loss of contact: parts of the record are faded from one "
            "possible motion into another"
        )
    return list(dict.fromkeys(remarks))
