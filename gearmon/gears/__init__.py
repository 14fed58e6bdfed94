"""Gears: what the gears of a machine are, and the stiffness with which they mesh.

From a machine to the numbers of an equation of motion: `kinematics` says at which orders shafts,
meshes and bearings show; `mesh_pairs` gives the pairs of a stage, with their geometry (ISO 21771)
and the stiffness of ISO 6336; `mesh_stiffness` gives k over its true period, as one of the forms
derived from the contact ratio or from the elastic energy of the teeth, with the teeth that a
`Fault` has damaged; `displacement_excitation` what errors and lost profile move; `stage_mechanics`
mass, damping, force and stiffness of a mesh at an operating point.

>>> from gearmon.gears import mesh_stiffness, parse_fault
>>> from gearmon.machine import ParallelStage
>>> stage = ParallelStage(pinion_teeth=26, gear_teeth=53, module_mm=2.0, face_width_mm=20.0)
>>> sound = mesh_stiffness(stage, form="potential-energy")
>>> cracked = mesh_stiffness(stage, [parse_fault("crack:1:pinion:5:1.5mm")], "potential-energy")
>>> sound.period_mesh, cracked.period_mesh
(1, 26)
>>> 0.97 < cracked.mean_n_per_m / sound.mean_n_per_m < 1
True

Two functions bear the names of their modules and are imported from there:
`gearmon.gears.kinematics.kinematics` and `gearmon.gears.stiffness_report.stiffness_report`.

The modules: `kinematics`; `geometry` (circles, rack, whether a pair can run); `pairs`, and their
ISO 6336 stiffness; `faults` (damage and errors as they are written); `pulses` (whatever a pair has,
loses or lacks over its contact); `tooth` and `tooth_pairs` (potential energy); `tooth_damage` and
`damage` (what is taken from a tooth, from its pair, and from the pairs that carry together);
`stiffness`; `excitation` (what errors move and modulate); `mechanics`, with the machine as one
elastic system, and `assembly` (how that is put together); `stiffness_report` (tables, and what
pictures need). Names load their module when first used.

Examples
--------
>>> from gearmon.gears import FORM_NAMES, Excitation, GearError, GearTeeth, Kinematics, MeshPair
>>> from gearmon.gears import MeshStiffness, MethodB, PairGeometry, PotentialEnergy, StageMechanics
>>> from gearmon.gears import StiffnessReport, compare_forms, displacement_excitation, line_table
>>> from gearmon.gears import mesh_pairs, parse_error, parse_fault_or_error
>>> from gearmon.gears import stage_mechanics, teeth_of
>>> from gearmon.gears.kinematics import kinematics
>>> from gearmon.gears.stiffness_report import stiffness_report
>>> turning = kinematics(machine)
>>> isinstance(turning, Kinematics), turning.mesh(1).order, turning.coincidences()
(True, 23.0, ())
>>> line_table(machine).rows[0]["name"]
'input shaft'
>>> (pair,) = mesh_pairs(machine.stages[0])
>>> isinstance(pair, MeshPair), pair.teeth, round(pair.contact_ratio, 2)
(True, (23, 57), 1.68)
>>> isinstance(pair.geometry, PairGeometry), isinstance(pair.geometry.gears[0], GearTeeth)
(True, True)
>>> isinstance(pair.method_b(), MethodB)
True
>>> found = mesh_stiffness(pair, form="potential-energy")
>>> isinstance(found, MeshStiffness), isinstance(found.form, PotentialEnergy)
(True, True)
>>> runout = parse_error("eccentricity:1:pinion:all:20um")
>>> moved = displacement_excitation(pair, found, [runout])
>>> isinstance(runout, GearError), isinstance(moved, Excitation), moved.period_mesh
(True, True, 23)
>>> mechanics = stage_mechanics(machine, 1)
>>> isinstance(mechanics, StageMechanics), round(mechanics.mesh_frequency_hz)
(True, 567)
>>> compare_forms(machine).contact_ratio > 1.6, FORM_NAMES[:2]
(True, ('parabolic', 'parabolic-maximum'))
>>> isinstance(stiffness_report(machine), StiffnessReport), teeth_of(pair) is not None
(True, True)
"""

from gearmon.lazy import lazily

_OFFERED = {
    "excitation": ("Excitation", "displacement_excitation"),
    "faults": (
        "ERROR_KINDS",
        "KINDS",
        "Fault",
        "GearError",
        "parse_error",
        "parse_fault",
        "parse_fault_or_error",
    ),
    "geometry": ("GearTeeth", "PairGeometry", "pair_geometry"),
    "kinematics": ("Kinematics", "line_table"),
    "mechanics": ("StageMechanics", "stage_mechanics"),
    "pairs": ("MeshPair", "MethodB", "mesh_pairs", "method_b"),
    "stiffness": ("FORM_NAMES", "MeshStiffness", "mesh_stiffness"),
    "stiffness_report": ("StiffnessReport", "compare_forms"),
    "tooth_pairs": ("PotentialEnergy", "teeth_of"),
}

__all__, __getattr__ = lazily(__name__, _OFFERED)
