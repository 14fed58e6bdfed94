"""Value objects of the kinematics: shafts, wheels, meshes, sideband families and lines.

An *order* is a frequency divided by the rotation frequency of shaft 1, the input. Orders of a
gear train are ratios of tooth counts, so they are kept as exact fractions beside their floating
values: that the mesh of one stage is exactly three times that of the next is then a fact and not
a matter of rounding.

References
----------
P. D. McFadden and J. D. Smith, An explanation for the asymmetry of the modulation sidebands about
the tooth meshing frequency in epicyclic gear vibration, Proc. IMechE 199 C1 (1985) 65-70.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from fractions import Fraction
from itertools import combinations
from typing import Any, TypeVar

from gearmon.errors import ArgumentError


@dataclass(frozen=True, kw_only=True)
class Shaft:
    """A shaft in the power flow.

    Parameters
    ----------
    number : int
        Counted from 1, the input.
    name : str
        What it is in the train.
    exact : Fraction
        Turns per turn of shaft 1, without sign.
    """

    number: int
    name: str
    exact: Fraction

    @property
    def order(self) -> float:
        """Turns per turn of shaft 1."""
        return float(self.exact)


@dataclass(frozen=True, kw_only=True)
class Wheel:
    """A gear in a mesh.

    Parameters
    ----------
    gear : {"pinion", "gear", "sun", "planet", "ring"}
    teeth : int
    shaft : int or None
        Shaft that it turns with; None if it stands still or turns on a planet pin.
    exact : Fraction
        Turns per turn of shaft 1, seen from the housing.
    exact_relative : Fraction
        Turns per turn of shaft 1 relative to the carrier (to the housing in a parallel stage):
        ``teeth * exact_relative`` is the mesh order.
    """

    gear: str
    teeth: int
    shaft: int | None
    exact: Fraction
    exact_relative: Fraction

    @property
    def order(self) -> float:
        """Turns per turn of shaft 1, seen from the housing."""
        return float(self.exact)

    @property
    def relative_order(self) -> float:
        """Turns per turn of shaft 1 relative to the carrier."""
        return float(self.exact_relative)


@dataclass(frozen=True, kw_only=True)
class Modulation:
    """The spacing of one family of sidebands about the harmonics of a mesh.

    Parameters
    ----------
    name : str
        What modulates, in words.
    gear : {"pinion", "gear", "sun", "planet", "ring", "carrier"}
        The member to blame.
    shaft : int or None
        Shaft that turns at this order, if any.
    exact : Fraction
        Spacing as an order of shaft 1.
    """

    name: str
    gear: str
    shaft: int | None
    exact: Fraction

    @property
    def order(self) -> float:
        """Spacing of the sidebands as an order of shaft 1."""
        return float(self.exact)


@dataclass(frozen=True, kw_only=True)
class Mesh:
    """The mesh of one stage; in a planetary set all meshes have the same frequency.

    Parameters
    ----------
    stage : int
        Counted from 1.
    name : str
    exact : Fraction
        Tooth pairs per turn of shaft 1.
    wheels : tuple of Wheel
        Pinion and gear, or sun, planet and ring.
    modulations : tuple of Modulation
        The families of sidebands to look for.
    planets : int
        Planets; 0 in a parallel stage.
    carrier : Fraction
        Signed order of the carrier, positive where tooth contacts on the ring run with it; 0 in a
        parallel stage or if the carrier stands still.
    equally_spaced : bool
        Whether the planets sit at equal angles.
    """

    stage: int
    name: str
    exact: Fraction
    wheels: tuple[Wheel, ...]
    modulations: tuple[Modulation, ...]
    planets: int = 0
    carrier: Fraction = Fraction(0)
    equally_spaced: bool = True

    @property
    def order(self) -> float:
        """Mesh frequency as an order of shaft 1."""
        return float(self.exact)

    @property
    def teeth(self) -> tuple[int, ...]:
        """Tooth counts, in the order of `wheels`."""
        return tuple(wheel.teeth for wheel in self.wheels)

    def wheel(self, gear: str) -> Wheel:
        """Return the wheel called `gear`.

        Raises
        ------
        ArgumentError
            If the stage has no such gear.
        """
        for wheel in self.wheels:
            if wheel.gear == gear:
                return wheel
        known = ", ".join(wheel.gear for wheel in self.wheels)
        raise ArgumentError(f"gear={gear!r} is not in stage {self.stage}; it has {known}")

    def healthy_orders(self, harmonic: int, reach: int = 2) -> tuple[float, ...]:
        """Return where a sensor on the housing sees one mesh harmonic of a faultless stage.

        Parameters
        ----------
        harmonic : int, 1 or more
            Harmonic of the mesh.
        reach : int, 1 or more
            Lines wanted on either side of the harmonic, for a planetary set.

        Returns
        -------
        tuple of float
            Orders, ascending: of a parallel stage the mesh harmonic alone.

        Raises
        ------
        ArgumentError
            If `harmonic` or `reach` is less than 1.

        Notes
        -----
        Past the sensor go N equal planets whose contacts with the ring differ in phase by
        2 pi z_r / N. Their sum leaves only the lines k f_m + s f_c with k z_r + s divisible by N
        (McFadden and Smith 1985): there may be none at the mesh harmonic itself. With unequal
        spacing nothing cancels and every s is possible.
        """
        if harmonic < 1 or reach < 1:
            raise ArgumentError(f"harmonic={harmonic} and reach={reach} must be 1 or more")
        if self.carrier == 0:
            return (float(harmonic * self.exact),)
        step = self.planets if self.equally_spaced else 1
        first = -harmonic * self.wheel("ring").teeth % step - step * reach
        shifts = (s for s in range(first, step * reach + 1, step))
        orders = (abs(harmonic * self.exact + s * self.carrier) for s in shifts)
        return tuple(float(order) for order in sorted(orders))


@dataclass(frozen=True, kw_only=True)
class Line:
    """A frequency that the machine can show.

    Parameters
    ----------
    kind : str
        "shaft", "mesh", "assembly phase", "hunting tooth", "rotation", "planet pass",
        "local fault" or "bearing".
    name : str
    stage : int or None
    shaft : int or None
    order : float
        In turns of shaft 1.
    exact : Fraction or None
        The same, exactly; None where angles enter (bearings).
    """

    kind: str
    name: str
    stage: int | None
    shaft: int | None
    order: float
    exact: Fraction | None


@dataclass(frozen=True, kw_only=True)
class Coincidence:
    """Two mesh harmonics at exactly the same frequency: their lines cannot be told apart."""

    stage: int
    harmonic: int
    other_stage: int
    other_harmonic: int


@dataclass(frozen=True, kw_only=True)
class Kinematics:
    """Shafts, meshes and lines of a machine.

    Parameters
    ----------
    shafts : tuple of Shaft
        Shaft 1 is the input; stage i lies between shafts i and i + 1.
    meshes : tuple of Mesh
        One for each stage.
    lines : tuple of Line
        Everything: the shafts, then each stage, then the bearings.
    """

    shafts: tuple[Shaft, ...]
    meshes: tuple[Mesh, ...]
    lines: tuple[Line, ...]

    def shaft(self, number: int) -> Shaft:
        """Return the shaft with this number, counted from 1.

        Raises
        ------
        ArgumentError
            If there is no such shaft.
        """
        return _numbered("shaft", self.shafts, number)

    def mesh(self, stage: int) -> Mesh:
        """Return the mesh of this stage, counted from 1.

        Raises
        ------
        ArgumentError
            If there is no such stage.
        """
        return _numbered("stage", self.meshes, stage)

    def coincidences(self, highest_harmonic: int = 20) -> tuple[Coincidence, ...]:
        """Return the lowest common harmonic of every two stages that have one.

        Parameters
        ----------
        highest_harmonic : int
            Harmonics above this do not count.
        """
        found = []
        for low, high in combinations(self.meshes, 2):
            ratio = low.exact / high.exact
            if max(ratio.numerator, ratio.denominator) <= highest_harmonic:
                found.append(
                    Coincidence(
                        stage=low.stage,
                        harmonic=ratio.denominator,
                        other_stage=high.stage,
                        other_harmonic=ratio.numerator,
                    )
                )
        return tuple(found)


@dataclass(frozen=True, kw_only=True)
class LineRow:
    """A line at one operating point."""

    operating: str
    speed_rpm: float
    stage: int | None
    kind: str
    name: str
    shaft: int | None
    order: float
    frequency_hz: float


@dataclass(frozen=True, kw_only=True)
class LineTable:
    """The lines of a machine at its operating points.

    Parameters
    ----------
    machine : str
        Name of the machine.
    rows : tuple of LineRow
    notes : tuple of str
        Remarks on the machine file and on lines that coincide.
    """

    machine: str
    rows: tuple[LineRow, ...]
    notes: tuple[str, ...] = ()

    def __iter__(self) -> Iterator[LineRow]:
        return iter(self.rows)

    def __len__(self) -> int:
        return len(self.rows)

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types only, ready for JSON."""
        return {
            "machine": self.machine,
            "rows": [asdict(row) for row in self.rows],
            "notes": list(self.notes),
        }


_Item = TypeVar("_Item")


def _numbered(what: str, items: tuple[_Item, ...], number: int) -> _Item:
    if not 1 <= number <= len(items):
        raise ArgumentError(f"{what}={number} must lie in [1, {len(items)}]")
    return items[number - 1]
