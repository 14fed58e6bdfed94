"""Mesh stiffness modulated by errors of turning gears, against circles, samples and Bessel sums."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import jv

from gearmon.gears.excitation import contact_offsets, state_of
from gearmon.gears.faults import parse_error
from gearmon.gears.pairs import mesh_pairs
from gearmon.gears.stiffness import FORM_NAMES, mesh_stiffness
from gearmon.machine import ParallelStage, PlanetaryStage

STAGE = ParallelStage(pinion_teeth=26, gear_teeth=53, module_mm=2.0, face_width_mm=20.0)
SMALL = replace(STAGE, pinion_teeth=19, gear_teeth=23)
HELICAL = replace(STAGE, helix_angle_deg=15.0)
PLANETARY = PlanetaryStage(
    sun_teeth=20, planet_teeth=40, ring_teeth=100, planets=4, module_mm=1.0, face_width_mm=10.0
)
FORCE = 4000.0


def modulated(*errors, stage=STAGE, form="parabolic", force=FORCE):
    return mesh_stiffness(stage, [parse_error(e) for e in errors], form, force_n=force)


def sampled_lines(mesh, points, count):
    phase = (np.arange(mesh.period_mesh * points) + 0.5) / points
    lines = np.fft.rfft(mesh.at(phase))[: count + 1] / len(phase)
    return lines * np.exp(-1j * np.pi * np.arange(count + 1) / len(phase)) / mesh.mean_n_per_m


# --- where contact begins and ends ---------------------------------------------------------------


class TurningCircles:
    """Base circles whose centres run around their shafts, the first gear turning anticlockwise.

    The line of action lies along y where nothing runs out.
    """

    def __init__(self, pair, index, size):
        geometry = pair.geometry
        self.index, self.size = index, size
        self.side = -1 if pair.second.internal else 1
        self.one, self.two = geometry.base_radii_m
        line = geometry.centre_distance_m * math.sin(geometry.working_pressure_angle_rad)
        self.shaft = np.array([self.one + self.side * self.two, self.side * line])
        self.turns = (1, -self.side)

    def centres(self, angles):
        found = [np.zeros(2), self.shaft.copy()]
        # the first gear stands back along -y, the second along +y
        start = (-math.pi / 2, math.pi / 2)[self.index]
        own = start + self.turns[self.index] * angles[self.index]
        found[self.index] += self.size * np.array([math.cos(own), math.sin(own)])
        return found

    def normal(self, angles):
        """Direction from the first centre to where the common tangent touches."""
        one, two = self.centres(angles)
        apart = two - one
        sum_of_radii = self.one + self.side * self.two
        open_angle = math.acos(sum_of_radii / math.hypot(*apart))
        own = math.atan2(apart[1], apart[0]) - self.side * open_angle
        return np.array([math.cos(own), math.sin(own)])


def meets(circles, index, roll, even, teeth):
    """Phase near `even` at which the end of a flank of an evenly turning gear is in contact."""
    base = (circles.one, circles.two)[index]
    tip = math.hypot(base, roll)
    facing = 0.0 if index == 0 or circles.side < 0 else math.pi
    sense = circles.turns[index]

    def off_the_line(phase):
        angles = [2 * math.pi * phase / z for z in teeth]
        turned = 2 * math.pi * (phase - even) / teeth[index]
        # the flank of either external gear leans towards its own turning at the tip
        lean = math.atan2(roll, base)
        own = facing + lean + sense * turned
        point = tip * np.array([math.cos(own), math.sin(own)])
        along = circles.normal(angles) * (-1 if facing else 1)
        return float(point @ along) - base

    return brentq(off_the_line, even - 0.2, even + 0.2, xtol=1e-14)


@pytest.mark.parametrize("index", [0, 1])
@pytest.mark.parametrize(
    ("stage", "mesh"),
    [(STAGE, 0), (replace(STAGE, centre_distance_mm=79.5), 0), (PLANETARY, 0), (PLANETARY, 1)],
)
def test_contact_begins_and_ends_where_circles_say(stage, mesh, index, monkeypatch):
    """What is left out is of the second order: it falls with the square of the size."""
    pair = mesh_pairs(stage, 1)[mesh]
    geometry = pair.geometry
    teeth = tuple(member.teeth for member in pair.members)
    gear = pair.members[index].name
    rolls = [
        math.sqrt(tip**2 - base**2)
        for tip, base in zip(geometry.tip_radii_m, geometry.base_radii_m, strict=True)
    ]
    eps = geometry.transverse_contact_ratio
    missed = []
    for size in (4e-6, 8e-6):
        circles = TurningCircles(pair, index, size)
        error = parse_error(f"eccentricity:1:{gear}:all:{1e6 * size}um")
        worst = 0.0
        for entry in range(0, teeth[index], 3):
            for who, name, even in ((0, "leaving", entry + eps), (1, "entering", float(entry))):
                # the gear whose tip is looked at turns evenly
                share = float(who)
                monkeypatch.setattr(
                    "gearmon.gears.excitation.first_gear_share", lambda _, s=share: s
                )
                offsets = contact_offsets(pair, [error])
                found = meets(circles, who, rolls[who], even, teeth)
                leaving, entering, _ = state_of(offsets, np.array(found), 0.0)
                shift = float(leaving if name == "leaving" else entering)
                moved = found - even if name == "entering" else even - found
                worst = max(worst, abs(moved - shift))
        missed.append(worst)
    assert missed[0] < 4e-6 / geometry.base_pitch_m * 5e-3
    assert missed[1] == pytest.approx(4 * missed[0], rel=0.1)


# --- the curve and its lines ---------------------------------------------------------------------


def parabola_by_hand(stage, error, index, phase):
    """k(t) sample by sample from the shifted contact: centre distance and offset by hand."""
    (pair,) = mesh_pairs(stage)
    z1, z2 = stage.pinion_teeth, stage.gear_teeth
    one, two = (0.5e-3 * stage.module_mm * z * math.cos(math.radians(20)) for z in (z1, z2))
    distance = 0.5e-3 * stage.module_mm * (z1 + z2)
    line = math.sqrt(distance**2 - (one + two) ** 2)
    pitch = 2 * math.pi * one / z1
    share = z2**2 / (z1**2 + z2**2)
    angle = 2 * math.pi * phase / (z1, z2)[index]
    along, across = error * math.cos(angle), (-1, 1)[index] * error * math.sin(angle)
    length = math.sqrt(
        (distance + (along * line + across * (one + two)) / distance) ** 2 - (one + two) ** 2
    )
    eps = pair.contact_ratio
    begins = (two * across / line + (1 - share) * along) / pitch
    shorter = eps - (length - line) / pitch
    best = mesh_stiffness(stage, ()).at(1 - 0.5 * (2 - eps))
    total = 0.0
    for entry in range(math.floor(phase) - 2, math.floor(phase) + 2):
        x = (phase - entry - begins) / shorter
        if 0 <= x < 1:
            total += float(best) * (1 - 0.45 * (2 * x - 1) ** 2)
    return total


@pytest.mark.parametrize("index", [0, 1])
def test_curve_is_that_of_the_shifted_contact_at_each_instant(index):
    gear = ("pinion", "gear")[index]
    mesh = modulated(f"eccentricity:1:{gear}:all:20um")
    phase = np.linspace(0.0123, 53.0123, 700, endpoint=False)
    by_hand = np.array([parabola_by_hand(STAGE, 20e-6, index, p) for p in phase.tolist()])
    far = np.abs(mesh.at(phase) - by_hand) > 2e-5 * mesh.mean_n_per_m
    # at the ends of a contact, where k jumps, the second order of the offset decides
    assert far.sum() <= 1


@pytest.mark.parametrize("form", [name for name in FORM_NAMES if "fourier" not in name])
@pytest.mark.parametrize(
    "errors",
    [
        ["eccentricity:1:pinion:all:20um"],
        ["eccentricity:1:pinion:all:30um", "cumulative:1:pinion:all:-10um"],
        ["eccentricity:1:pinion:all:20um", "misalignment:1:pinion:all:40um"],
    ],
)
def test_lines_are_those_of_samples(form, errors):
    """Helical: k is continuous and samples alias little."""
    mesh = modulated(*errors, stage=HELICAL, form=form)
    assert mesh.period_mesh == 26
    count = 3 * 26 + 8
    slow = sampled_lines(mesh, 512, count)
    assert slow[0] == pytest.approx(1, abs=2e-7)
    np.testing.assert_allclose(mesh.harmonics(count), slow[1:], atol=2e-7)


def test_lines_of_a_fourier_sum_are_those_of_samples():
    """It has no jumps and no corners."""
    mesh = modulated("eccentricity:1:gear:all:20um", form="fourier")
    slow = sampled_lines(mesh, 130, 120)
    np.testing.assert_allclose(mesh.harmonics(120), slow[1:], atol=1e-13)


@pytest.mark.parametrize("form", ["parabolic", "potential-energy"])
def test_lines_of_both_gears_over_the_hunting_period(form):
    stage = replace(SMALL, helix_angle_deg=20.0)
    errors = ["eccentricity:1:pinion:all:20um", "eccentricity:1:gear:all:30um"]
    mesh = modulated(*errors, stage=stage, form=form)
    assert mesh.period_mesh == 19 * 23
    count = 3 * mesh.period_mesh
    points = 256 if form == "parabolic" else 64
    slow = sampled_lines(mesh, points, count)
    # a continuous curve with corners: aliases fall with the square of the samples
    lines = mesh.harmonics(count)
    np.testing.assert_allclose(lines, slow[1:], atol=2e-7 * (256 / points) ** 2)
    # the lines of either gear alone are there, and sums and differences of both
    found = np.abs(lines)
    first = mesh.period_mesh - 1
    assert min(found[first + 23], found[first - 19]) > 1e-5
    assert found[first + 23 - 19] > 1e-8


@pytest.mark.parametrize("size", [5.0, 50.0, 400.0])
def test_pure_delay_is_a_bessel_sum(size):
    """Cumulative pitch error leaves the contact as long as it is: c_m J_s(2 pi m b)."""
    mesh = modulated(f"cumulative:1:pinion:all:{size}um", stage=HELICAL)
    plain = mesh.healthy.coefficients(np.arange(1, 7))
    (pair,) = mesh_pairs(HELICAL)
    along = 1e-6 * size / pair.geometry.base_pitch_m * 26**2 / (26**2 + 53**2)
    lines = mesh.harmonics(26 * 6) * mesh.mean_n_per_m
    for m in range(1, 6):
        for s in (-3, -2, -1, 0, 1, 2, 3):
            found = lines[26 * m + s - 1]
            beta = 2 * math.pi * m * along
            # exp(i beta cos x) = sum i^s J_s(beta) exp(i s x); lines of other harmonics come near
            # only where the index nears half the teeth
            expected = plain[m - 1] * (-1j) ** s * jv(s, beta)
            assert found == pytest.approx(expected, abs=1e-9 * abs(plain[0]))


def test_small_eccentricity_is_amplitude_and_phase_modulation():
    """S_j of one-line modulation, with the derivative of c_m with respect to the contact ratio."""
    errors = "eccentricity:1:pinion:all:1um"
    mesh = modulated(errors)
    (pair,) = mesh_pairs(STAGE)
    (offset,) = contact_offsets(pair, [parse_error(errors)])
    lost = offset.leaving + offset.entering
    eps, q = pair.contact_ratio, 0.45

    def pulse(order, length):
        w = math.pi * order * length
        bracket = (1 - q) * math.sin(w) / w - 2 * q * (math.cos(w) / w**2 - math.sin(w) / w**3)
        return length * bracket * np.exp(-1j * w)

    best = mesh.healthy_mean_n_per_m / (eps * (1 - q / 3))
    lines = mesh.harmonics(26 * 6) * mesh.mean_n_per_m
    for m in range(1, 6):
        middle = pulse(m, eps)
        slope = (pulse(m, eps - 1e-6) - pulse(m, eps + 1e-6)) / 2e-6 / middle
        turning = slope * 0.5 * lost - 2j * np.pi * m * 0.5 * offset.entering
        against = (
            slope * 0.5 * lost.conjugate() - 2j * np.pi * m * 0.5 * offset.entering.conjugate()
        )
        upper, lower = lines[26 * m], lines[26 * m - 2]
        scale = abs(best * middle * turning)
        assert upper == pytest.approx(best * middle * turning, abs=3e-3 * scale)
        assert lower == pytest.approx(best * middle * against, abs=3e-3 * scale)
        # alpha and beta of McFadden's model: upper and lower lines differ where both are there
        alpha = turning + np.conj(against)
        beta = (turning - np.conj(against)) / 1j
        psi = np.angle(beta) - np.angle(alpha)
        al, be = abs(alpha), abs(beta)
        part = math.sqrt(al**2 + be**2 - 2 * al * be * math.sin(psi)) / 2
        assert abs(upper) == pytest.approx(abs(best * middle) * part, rel=5e-3, abs=1e-6 * scale)


@pytest.mark.parametrize("form", ["parabolic", "potential-energy", "rectangular"])
@pytest.mark.parametrize("kind", ["eccentricity", "cumulative", "misalignment"])
def test_no_size_changes_nothing(form, kind):
    mesh = modulated(f"{kind}:1:pinion:all:0um", form=form)
    assert mesh.period_mesh == 1
    assert mesh.modulations == ()
    x = np.linspace(0, 3, 50)
    np.testing.assert_array_equal(mesh.at(x), mesh_stiffness(STAGE, (), form, force_n=FORCE).at(x))


@pytest.mark.parametrize("form", ["parabolic", "potential-energy"])
def test_sidebands_stand_at_every_mesh_harmonic_and_grow_with_the_size(form):
    small, large = (
        np.abs(modulated(f"eccentricity:1:pinion:all:{e}um", form=form).harmonics(26 * 8 + 2))
        for e in (4, 8)
    )
    for m in range(1, 9):
        line = 26 * m - 1
        both = [large[line - 1] + large[line + 1], small[line - 1] + small[line + 1]]
        assert both[0] == pytest.approx(2 * both[1], rel=0.02)
        second = [large[line - 2] + large[line + 2], small[line - 2] + small[line + 2]]
        assert second[0] == pytest.approx(4 * second[1], rel=0.05)


def test_a_misaligned_face_carries_in_part_twice_a_turn():
    """Winkler foundation: F = k g f^2/2, so that f = sqrt(2 F/(k g)) where g exceeds 2 F/k."""
    plain = mesh_stiffness(STAGE, (), force_n=FORCE)
    gap = 2 * FORCE / plain.mean_n_per_m
    closed = modulated(f"misalignment:1:pinion:all:{0.99e6 * gap}um")
    x = np.linspace(0, 26, 301)
    np.testing.assert_allclose(closed.at(x), plain.at(x), rtol=1e-12)
    wide = modulated(f"misalignment:1:pinion:all:{4e6 * gap}um")
    share = np.minimum(1, np.sqrt(1 / np.maximum(4 * np.abs(np.cos(2 * np.pi * x / 26)), 1e-9)))
    np.testing.assert_allclose(wide.at(x), share * plain.at(x), rtol=1e-9)
    lines = np.abs(wide.harmonics(60))
    assert min(lines[23], lines[27]) > 100 * max(lines[24], lines[26], 1e-15)


def test_misalignment_without_a_force_is_said_not_to_modulate():
    mesh = modulated("misalignment:1:pinion:all:40um", force=None)
    assert mesh.modulations == ()
    assert any("the static tooth force is not known" in words for words in mesh.warnings)


def test_contact_ratio_across_a_whole_number_keeps_the_delay():
    (usual,) = mesh_pairs(STAGE)
    stage = replace(STAGE, contact_ratio=2.001)
    assert usual.contact_ratio < 2
    mesh = modulated("eccentricity:1:pinion:all:50um", stage=stage, form="wave")
    assert any("across a whole number" in words for words in mesh.warnings)
    assert mesh.period_mesh == 26


def test_planet_and_ring_take_part():
    inner, outer = mesh_pairs(PLANETARY, 1)
    error = [parse_error("eccentricity:1:planet:all:15um")]
    for pair in (inner, outer):
        found = mesh_stiffness(pair, error)
        assert found.period_mesh == 40
        lines = np.abs(found.harmonics(45))
        assert min(lines[38], lines[40]) > 1e-6
