"""One tooth on its body by plane-stress finite elements, for discs and rings."""

from __future__ import annotations

import math

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import splu

#: Elements across the tooth, along its fillet, along its involute, through the body, around it.
ACROSS, FILLET, FLANK, THROUGH, AROUND = 8, 10, 14, 14, 60


class Mesh:
    """Blocks of nine-node elements that share the nodes where they touch."""

    def __init__(self):
        self.known, self.points, self.elements = {}, [], []

    def add(self, points):
        """Add a block, shape (2 rows + 1, 2 columns + 1, 2), and return its node numbers."""
        numbers = np.array([[self._node(tuple(p)) for p in row] for row in points])
        for i in range(0, len(numbers) - 1, 2):
            for j in range(0, numbers.shape[1] - 1, 2):
                self.elements.append(numbers[i : i + 3, j : j + 3].ravel())
        return numbers

    def _node(self, point):
        key = (round(point[0] * 1e9), round(point[1] * 1e9))
        if key not in self.known:
            self.known[key] = len(self.points)
            self.points.append(point)
        return self.known[key]


def tooth_compliance(tooth, rolls_m):
    """Compliance of tooth and body times E b, at the flank nodes nearest to roll lengths.

    The force acts on a node of the flank; its displacement is taken where its line meets the
    middle of the tooth, away from the dent. Returns pairs of roll length and compliance.
    """
    mesh = Mesh()
    rows, angles = _tooth_rows(tooth)
    numbers = mesh.add(rows)
    mesh.add(_body(tooth, rows[0]))
    points = np.array(mesh.points)
    held = np.abs(np.hypot(*points.T) - tooth.bore_radius_m) < 1e-9
    free = np.flatnonzero(~np.repeat(held, 2))
    stiff = _stiffness(points, np.array(mesh.elements), tooth.poisson_ratio)
    factors = splu(stiff[free][:, free].tocsc())
    found = []
    for roll in rolls_m:
        row = int(np.argmin(np.abs(angles - float(tooth.angle(roll)))))
        slope = float(tooth.slope(angles[row]))
        force = np.array([-math.cos(slope), -tooth.sign * math.sin(slope)])
        node = numbers[2 * FILLET + row, -1]
        load, moved = np.zeros(2 * len(points)), np.zeros(2 * len(points))
        load[2 * node : 2 * node + 2] = force
        moved[free] = factors.solve(load[free])
        middle = numbers[:, ACROSS]
        order = np.argsort(points[middle, 1])
        heights = points[middle, 1][order]
        meets = tooth.base_radius_m / math.cos(slope)
        assert heights[0] <= meets <= heights[-1]
        axis = [np.interp(meets, heights, moved[2 * middle + i][order]) for i in (0, 1)]
        found.append((float(tooth.roll(angles[row])), float(force @ axis)))
    return found


def _tooth_rows(tooth):
    """Rows of points across the tooth from its root to its tip, and the angles on the involute."""
    root = tooth.root_part(np.linspace(0, 1, 2 * FILLET + 1))
    height, half = root.imag, root.real
    angles = np.linspace(tooth.start, tooth.tip, 2 * FLANK + 1)
    half = np.concatenate([half[:-1], tooth.half_thickness(angles)])
    along = tooth.sign * np.concatenate([height[:-1], tooth.height(angles)])
    across = np.linspace(-1, 1, 2 * ACROSS + 1)
    turn = across * math.atan2(half[0], along[0])
    root = tooth.root_radius_m
    rows = [np.stack([root * np.sin(turn), root * np.cos(turn)], axis=-1)]
    bulge = root * (np.cos(turn) - np.cos(turn[0]))
    for number, (h, y) in enumerate(zip(half[1:], along[1:], strict=True), start=1):
        bent = y + bulge * max(0.0, 1 - number / (2 * FILLET))
        rows.append(np.stack([h * across, bent], axis=-1))
    return np.array(rows), angles


def _body(tooth, root_row):
    """Points of the whole disc or ring, finer towards the tooth."""
    arc = np.arctan2(root_row[:, 0], root_row[:, 1])
    growing = np.linspace(0, 1, 2 * AROUND + 1)[1:] ** 2.2
    beside = arc[-1] + (math.pi - arc[-1]) * growing
    turn = np.concatenate([-beside[::-1], arc, beside])
    deep = np.linspace(0, 1, 2 * THROUGH + 1) ** 1.7
    radii = tooth.root_radius_m + (tooth.bore_radius_m - tooth.root_radius_m) * deep
    return np.stack([np.outer(radii, np.sin(turn)), np.outer(radii, np.cos(turn))], axis=-1)


def _stiffness(points, elements, nu):
    """Stiffness matrix for E = 1 and unit width."""
    elastic = np.array([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]]) / (1 - nu**2)
    nodes, weights = np.polynomial.legendre.leggauss(3)
    corners = points[elements]
    total = np.zeros((len(elements), 18, 18))
    for a, wa in zip(nodes, weights, strict=True):
        for b, wb in zip(nodes, weights, strict=True):
            (na, da), (nb, db) = _shape(a), _shape(b)
            slopes = np.stack([np.outer(da, nb).ravel(), np.outer(na, db).ravel()])
            jacobian = np.einsum("ak,ekd->ead", slopes, corners)
            slopes = np.linalg.solve(jacobian, np.broadcast_to(slopes, (len(elements), 2, 9)))
            strain = np.zeros((len(elements), 3, 18))
            strain[:, 0, 0::2], strain[:, 1, 1::2] = slopes[:, 0], slopes[:, 1]
            strain[:, 2, 0::2], strain[:, 2, 1::2] = slopes[:, 1], slopes[:, 0]
            area = np.abs(np.linalg.det(jacobian)) * wa * wb
            total += np.einsum("eki,kl,elj,e->eij", strain, elastic, strain, area)
    places = np.stack([2 * elements, 2 * elements + 1], axis=-1).reshape(len(elements), 18)
    row, column = np.repeat(places, 18, axis=1).ravel(), np.tile(places, (1, 18)).ravel()
    return csr_matrix((total.ravel(), (row, column)), shape=(2 * len(points),) * 2)


def _shape(x):
    """Quadratic shape functions and their slopes."""
    return np.array([0.5 * x * (x - 1), 1 - x * x, 0.5 * x * (x + 1)]), np.array(
        [x - 0.5, -2 * x, x + 0.5]
    )
