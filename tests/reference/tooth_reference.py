"""Slow, obvious versions of tooth stiffness: one contact, one section, one pair at a time."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from scipy.integrate import quad


def section(half, width, crack=None, h_root=None, loaded=None, holes=(), height=None, slices=4000):
    """Area and second moment of one section; a crack is averaged over slices of the face."""
    side = half if loaded is None else loaded
    if crack is None:
        area, inertia = width * (half + side), width * (half + side) ** 3 / 12
    else:
        places = (np.arange(slices) + 0.5) / slices
        depth = crack.at(places)
        # what the sound section has beyond the root half thickness goes twice as fast
        kept = np.maximum(half - h_root - 2 * depth, 0.0)
        limit = np.where(depth > 0, h_root - depth * math.sin(crack.angle_rad) + kept, np.inf)
        thickness = half + np.minimum(side, limit)
        area, inertia = width * thickness.mean(), width * (thickness**3).mean() / 12
    for hole in holes:
        lost = float(hole.width(np.array([height]))[0])
        removed = lost * hole.depth_m
        # the rest about its own centroid, by the parallel-axis rule from the middle of the whole
        mean = area / width
        arm = mean / 2 - hole.depth_m / 2
        shift = removed * arm / (area - removed)
        inertia += area * shift**2
        inertia -= lost * hole.depth_m**3 / 12 + removed * (arm + shift) ** 2
        area -= removed
    return area, inertia


def tooth_compliance(tooth, angle, damage=None, slices=400):
    """Bending, shear and axial compliance for one contact, by adaptive quadrature over angles.

    The variable is Tian's angle, measured from the contact downwards; the root is a polyline.
    """
    alpha2, radius = tooth.base_half_angle, tooth.base_radius_m
    width, young, shear_modulus = tooth.face_width_m, tooth.elastic_modulus_pa, None
    shear_modulus = young / 2 / (1 + tooth.poisson_ratio)
    crack = None if damage is None else damage.crack
    holes = () if damage is None else damage.holes
    wear = 0.0 if damage is None else damage.wear_m

    def profile(a):
        # Tian: a = -t
        x = radius * (math.cos(a) - (alpha2 - a) * math.sin(a))
        h = radius * ((alpha2 - a) * math.cos(a) + math.sin(a))
        return x, h

    contact_x, contact_h = profile(-angle)

    def energies(x, h, loaded, on_flank):
        area, inertia = section(
            h,
            width,
            crack,
            tooth.crack_start.real,
            loaded,
            holes if on_flank else (),
            x,
            slices,
        )
        moment = (contact_x - x) * math.cos(angle) - contact_h * math.sin(angle)
        return np.array(
            [
                moment**2 / (young * inertia),
                1.2 * math.cos(angle) ** 2 / (shear_modulus * area),
                math.sin(angle) ** 2 / (young * area),
            ]
        )

    def on_flank(a, which):
        x, h = profile(a)
        return (
            energies(x, h, h - wear / math.cos(a), True)[which]
            * radius
            * (alpha2 - a)
            * math.cos(a)
        )

    corners = [] if damage is None else [-c for c in damage.corners(tooth).tolist()]
    inside = sorted({c for c in corners if -angle < c < -tooth.start})
    limits = [-angle, *inside, -tooth.start]
    flank = [
        sum(
            quad(on_flank, low, high, args=(which,), epsrel=1e-9, limit=200)[0]
            for low, high in pairwise(limits)
        )
        for which in range(3)
    ]
    return np.array(flank) + _root(tooth, energies)


def _root(tooth, energies, points=1500):
    if tooth.root_part is None:
        return np.zeros(3)
    edges = np.linspace(0, 1, points + 1)
    height, middle = tooth.root_part(edges).imag, tooth.root_part(0.5 * (edges[1:] + edges[:-1]))
    terms = [
        energies(x, h, h, False) * step
        for x, h, step in zip(middle.imag, middle.real, np.diff(height), strict=True)
    ]
    return np.sum(terms, axis=0)


def coupled_mesh(pair, phase, losses, teeth, is_coupled=True):
    """Stiffness of all pairs in contact at one mesh phase, by the matrix of compliances.

    Parameters
    ----------
    losses : two dicts {tooth: function of contact phase -> loss}
    """
    eps = pair.contact_ratio
    entries = [n for n in range(math.floor(phase) - 3, math.floor(phase) + 1) if phase - n < eps]
    total, bodies = [], []
    for entry in entries:
        parts = pair.compliances(pair.roll(phase - entry))
        ratio = 1.0
        for of_gear, z in zip(losses, teeth, strict=True):
            loss = of_gear.get(entry % z + 1)
            ratio += 0.0 if loss is None else 1 / (1 - loss(phase - entry)) - 1
        total.append(float(parts.total) * ratio)
        bodies.append([float(body) for body in parts.foundation])
    matrix = np.diag(total)
    for i in range(len(entries)):
        for j in range(len(entries)):
            if i != j and is_coupled:
                matrix[i, j] = sum(
                    min(f.coupling(abs(entries[i] - entries[j])), bodies[i][g], bodies[j][g])
                    for g, f in enumerate(pair.foundations)
                )
    return np.linalg.solve(matrix, np.ones(len(entries))).sum()
