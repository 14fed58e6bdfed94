"""Makes the tables of this catalogue anew: ``python signatures/make_tables.py``.

Of every machine file NAME.toml of a folder there is the healthy line table NAME.csv, as `gearmon
baseline` writes it, and NAME-family.csv, lines about the first mesh harmonics with every kind of
fault of every gear at every operating point.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from gearmon.errors import ArgumentError
from gearmon.gears.kinematics import kinematics
from gearmon.machine import Machine, load_machine
from gearmon.signatures.expected.baseline import expected_signature
from gearmon.signatures.expected.fault_family import FAMILY_KINDS, fault_family
from gearmon.signatures.signature import Signature, write_signature

#: Sizes in the catalogue, and lines: so many mesh harmonics, so many sidebands to each side.
SIZES = ("5%", "20%", "10um", "40um")
MESH_HARMONICS, SIDEBANDS = 3, 3
#: Significant digits of the numbers in the family tables.
DIGITS = 6
FAMILY_SUFFIX = "-family"


def machine_files(folder: str | Path) -> tuple[Path, ...]:
    """Return the machine files of a catalogue, sorted by name.

    Raises
    ------
    ArgumentError
        If there is none.
    """
    found = tuple(sorted(Path(folder).glob("*.toml")))
    if not found:
        raise ArgumentError(f"{folder}: holds no machine files (*.toml)")
    return found


def healthy_table(machine: Machine) -> Signature:
    """Return the lines of the healthy machine at its first operating point."""
    return expected_signature(machine)


def family_table(machine: Machine, kinds: Sequence[str] = FAMILY_KINDS) -> Signature:
    """Return the lines of the machine with every kind of fault, rounded to `DIGITS` digits.

    Parameters
    ----------
    machine : Machine
        With the data that a baseline needs.
    kinds : sequence of str
        Kinds of fault, of `FAMILY_KINDS`.

    Returns
    -------
    Signature
        See `FaultFamily.table`; of `SIZES`, `MESH_HARMONICS` and `SIDEBANDS`.
    """
    family = fault_family(machine, kinds=kinds, sizes=SIZES, max_hz=_highest_hz(machine))
    return rounded(family.table(MESH_HARMONICS, SIDEBANDS))


def write_catalogue(folder: str | Path, names: Iterable[str] | None = None) -> tuple[Path, ...]:
    """Write the tables of all machine files of a folder beside them.

    Parameters
    ----------
    folder : str or Path
    names : iterable of str, optional
        Machine files, without ``.toml``; by default all.

    Returns
    -------
    tuple of Path
        What was written.
    """
    wanted = None if names is None else set(names)
    written = []
    for path in machine_files(folder):
        if wanted is not None and path.stem not in wanted:
            continue
        machine = load_machine(path)
        healthy = path.with_suffix(".csv")
        family = path.with_name(f"{path.stem}{FAMILY_SUFFIX}.csv")
        write_signature(healthy_table(machine), healthy)
        write_signature(family_table(machine), family)
        written += [healthy, family]
    return tuple(written)


def rounded(signature: Signature, digits: int = DIGITS) -> Signature:
    """Return a signature with its numbers rounded to significant digits."""
    columns = {name: signature[name] for name in signature.columns}
    for name, column in columns.items():
        if column.dtype.kind == "f":
            columns[name] = np.array([float(f"{value:.{digits}g}") for value in column.tolist()])
    return Signature(
        machine=signature.machine,
        origin=signature.origin,
        header=signature.header,
        columns=columns,
    )


def _highest_hz(machine: Machine) -> float:
    """Return a frequency [Hz] that no line in the catalogue exceeds."""
    fewest = min(wheel.teeth for mesh in kinematics(machine).meshes for wheel in mesh.wheels)
    order = max(mesh.order for mesh in kinematics(machine).meshes)
    speed = max(point.shaft1_hz for point in machine.operating)
    return order * speed * (MESH_HARMONICS + (SIDEBANDS + 1) / fewest)


if __name__ == "__main__":
    write_catalogue(Path(__file__).parent)
