"""Errors of gears and lost profile through the whole chain, against steps in time."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from reference.mesh_curves import parabola

from gearmon.errors import ArgumentError
from gearmon.gears.mechanics import stage_mechanics
from gearmon.machine import Machine, OperatingPoint, ParallelStage
from gearmon.signatures.expected.baseline import expected_signature

POINT = OperatingPoint(speed_rpm=1460.0, torque_nm=98.12)
SMALL = ParallelStage(
    pinion_teeth=9,
    gear_teeth=14,
    contact_ratio=1.4,
    mesh_stiffness_n_per_m=2e8,
    equivalent_mass_kg=0.9,
    damping_ratio=0.1,
    force_n=3000.0,
)
PAIR = ParallelStage(pinion_teeth=26, gear_teeth=53, module_mm=2.0, face_width_mm=20.0)


def box(stage=SMALL):
    return Machine(name="box", operating=(POINT,), stages=(stage,))


def steps_in_time(stiffness, error, mechanics, period_s):
    """Periodic z of m z'' + c (z - e)' + k (z - e) = F with k and e constant over short steps.

    q = z' - (c/m) e has no jump where e has one.
    """
    m, c, force = mechanics.equivalent_mass_kg, mechanics.damping_ns_per_m, mechanics.force_n
    step = period_s / len(stiffness)
    h = c / (2 * m)
    rate = np.sqrt(stiffness / m - h**2)
    fade, even, odd = np.exp(-h * step), np.cos(rate * step), np.sin(rate * step) / rate
    a, b = fade * (even + h * odd), fade * odd
    low, d = -fade * odd * stiffness / m, fade * (even - h * odd)
    rest, slow = force / stiffness + error, -c / m * error
    columns = [column.tolist() for column in (a, b, low, d, rest, slow)]
    paths, ends = [], []
    for z, q, push in ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)):
        path = []
        for ai, bi, ci, di, ri, si in zip(*columns, strict=True):
            path.append(z)
            y, w = z - push * ri, q - push * si
            z, q = push * ri + ai * y + bi * w, push * si + ci * y + di * w
        paths.append(np.array(path))
        ends.append(np.array([z, q]))
    start = np.linalg.solve(np.eye(2) - np.array(ends[1:]).T, ends[0])
    return paths[0] + start[0] * paths[1] + start[1] * paths[2]


def carrying(gap):
    """Part of the face that carries: the gap across it less than 2 F/k is closed by the load."""
    return min(1.0, math.sqrt(2 * 3000.0 / 2e8 / max(gap, 1e-9)))


def shifted_contact(phase, size, teeth, index):
    """k over its mean as pairs enter and leave, with gears of module 2 mm on 23 mm."""
    one, two = (math.cos(math.radians(20)) * z * 1e-3 for z in (9, 14))
    line, pitch = 23e-3 * math.sin(math.radians(20)), 2e-3 * math.pi * math.cos(math.radians(20))
    share, ratio = 14**2 / (9**2 + 14**2), 1.4
    turned = 2 * math.pi * phase / teeth
    along, across = size * np.cos(turned), size * np.sin(turned) * (-1, 1)[index]
    late = (two * across / line + (1 - share) * along) / pitch
    early = (one * across / line + share * along) / pitch
    total = np.zeros(len(phase))
    for back in range(-1, 3):
        x = (phase - np.floor(phase) + back - late) / (ratio - late - early)
        total += np.where((x >= 0) & (x < 1), 1 - 0.45 * (2 * x - 1) ** 2, 0.0)
    return total / (0.85 * ratio)


def parabolic_error(kind, size, tooth, teeth, ratio=1.4):
    """e(t) written down by itself: what each pair lacks, weighted by its share of the load."""

    def at(phase):
        if kind == "eccentricity":
            return size * math.cos(2 * math.pi * phase / teeth)
        if kind == "misalignment":
            gap = size * abs(math.cos(2 * math.pi * phase / teeth))
            return 0.5 * gap * (carrying(gap) - 1)
        last = math.floor(phase)
        load = {entry: parabola(phase - entry, ratio) for entry in (last - 1, last)}
        own = {
            entry: (
                (size if entry % teeth == tooth - 1 else 0.0)
                if kind == "pitch"
                else size * (2 * (phase - entry) / ratio - 1) ** 2
            )
            for entry in load
        }
        return sum(load[e] * own[e] for e in load) / sum(load.values())

    return at


def slow_lines(fault, teeth, points, count, stage=SMALL):
    kind, _, gear, tooth, size = fault.split(":")
    mechanics = stage_mechanics(box(stage), 1)
    phase = (np.arange(teeth * points) + 0.5) / points
    one = parabolic_error(kind, 1e-6 * float(size[:-2]), 0 if tooth == "all" else int(tooth), teeth)
    error = np.array([one(p) for p in phase.tolist()])
    stiffness = mechanics.stiffness.at(phase)
    if kind == "misalignment":
        gaps = 1e-6 * float(size[:-2]) * np.abs(np.cos(2 * np.pi * phase / teeth))
        stiffness = stiffness * np.array([carrying(gap) for gap in gaps.tolist()])
    if kind == "eccentricity" and stage.module_mm:
        # means over the steps: the jumps shift from tooth to tooth and are not met by them
        fine = (np.arange(64 * len(phase)) + 0.5) / (64 * points)
        index = ("pinion", "gear").index(gear)
        shifted = shifted_contact(fine, 1e-6 * float(size[:-2]), teeth, index)
        stiffness = 2e8 * shifted.reshape(-1, 64).mean(axis=1)
    z = steps_in_time(stiffness, error, mechanics, teeth / mechanics.mesh_frequency_hz)
    return np.fft.rfft(z)[: count + 1] / len(z)


MODULE = replace(SMALL, module_mm=2.0)


@pytest.mark.parametrize(
    ("fault", "teeth", "relative", "stage"),
    [
        ("eccentricity:1:pinion:all:60um", 9, 2e-5, SMALL),
        ("eccentricity:1:gear:all:25um", 14, 2e-5, SMALL),
        ("misalignment:1:pinion:all:40um", 9, 2e-5, SMALL),
        # the jumps of k fall within steps
        ("eccentricity:1:pinion:all:40um", 9, 1e-3, MODULE),
        ("eccentricity:1:gear:all:25um", 14, 1e-3, MODULE),
        # jumps of e fall as 1/n, and so does what the harmonics left out do
        ("pitch:1:pinion:4:12um", 9, 2e-3, SMALL),
        ("profile:1:gear:all:8um", 1, 2e-3, SMALL),
    ],
)
def test_errors_against_steps_in_time(fault, teeth, relative, stage):
    found = expected_signature(box(stage), [fault], max_hz=2200.0)
    lines = round(found["frequency_hz"].max() * teeth / found.header["mesh_frequency_hz"])
    steps = (200, 400) if stage is SMALL else (800, 1600)
    coarse, fine = (slow_lines(fault, teeth, n, lines, stage) for n in steps)
    exact = ((4 * fine - coarse) / 3)[1:]
    at = np.round(found["order"] / 9 * teeth).astype(int) - 1
    z = 0.5 * found["displacement_m"] * np.exp(1j * found["phase_rad"])
    angular = 2 * math.pi * found["frequency_hz"]
    error = np.linalg.norm(angular**2 * (z - exact[at])) / np.linalg.norm(angular**2 * exact[at])
    assert error < relative
    steps_apart = np.linalg.norm(angular**2 * (fine - coarse)[1:][at])
    slack = 2e-5 if stage is SMALL else steps_apart / np.linalg.norm(angular**2 * exact[at])
    assert error < found.header["error_estimate"] + slack
    if teeth > 1:
        # the sidebands at one turn from the first mesh line are there, and right by themselves
        for line in (teeth - 2, teeth):
            assert z[at == line] == pytest.approx(exact[line], rel=20 * relative)
            assert abs(exact[line]) > 0


def test_nothing_extra_for_a_healthy_mesh(monkeypatch):
    def forbidden(*_):
        raise AssertionError("no excitation was asked for")

    monkeypatch.setattr("gearmon.gears.excitation.Excitation.at", forbidden)
    expected_signature(box(), [])


def test_errors_of_no_size_change_nothing():
    healthy = expected_signature(box(), [])
    found = expected_signature(box(), ["eccentricity:1:pinion:all:0um", "pitch:1:gear:3:0um"])
    for name, column in healthy.columns.items():
        np.testing.assert_array_equal(found[name], column)


def test_errors_scale_and_add():
    """The equation is linear in e: deflections by errors of both gears add up exactly."""
    both = ["eccentricity:1:pinion:all:20um", "pitch:1:gear:5:10um"]
    kw = {"max_hz": 1500.0}
    healthy = expected_signature(box(), [], **kw)
    alone = [expected_signature(box(), [one], **kw) for one in both]
    together = expected_signature(box(), both, **kw)

    def coefficients(signature):
        z = signature["displacement_m"] * np.exp(1j * signature["phase_rad"])
        return dict(zip(np.round(signature["order"], 9).tolist(), z, strict=True))

    total = coefficients(together)
    parts = [coefficients(signature) for signature in (*alone, healthy)]
    size = max(abs(value) for value in total.values())
    for order, value in total.items():
        expected = sum(
            sign * part.get(order, 0) for sign, part in zip((1, 1, -1), parts, strict=True)
        )
        assert abs(value - expected) < 1e-5 * size
    assert set(together["sideband_of"]) == {"", "pinion", "gear"}


@pytest.mark.parametrize("loss", [2, 10, 30])
@pytest.mark.parametrize("also", [[], ["wear:1:gear:all:5%"]])
def test_damage_of_both_gears_is_that_of_the_hunting_period(loss, also):
    faults = [f"crack:1:pinion:2:{loss}%", f"crack:1:gear:3:{loss}%", *also]
    quick = expected_signature(box(), faults, max_hz=2000.0)
    whole = expected_signature(box(), faults, 1e-5, max_hz=2000.0, method="msm least residual")
    np.testing.assert_allclose(quick["order"], whole["order"], rtol=1e-12)
    np.testing.assert_array_equal(quick["sideband_of"], whole["sideband_of"])
    lines = [s["acceleration_ms2"] * np.exp(1j * s["phase_rad"]) for s in (quick, whole)]
    error = np.linalg.norm(lines[0] - lines[1]) / np.linalg.norm(lines[1])
    assert error < quick.header["error_estimate"] + whole.header["error_bound"] < 2e-3
    assert quick.header["error_estimate"] < 1e-6
    for signature in (quick, whole):
        assert signature.header["cross_lines_share"] > 0
    shares = quick.header["cross_lines_share"], whole.header["cross_lines_share"]
    assert shares[0] == pytest.approx(shares[1], rel=1e-2)


def test_a_through_spall_moves_the_flanks_and_a_narrower_one_does_not():
    header = {}
    for width in (20, 12):
        faults = [f"spall:1:pinion:5:{width}x1x0.05mm"]
        found = expected_signature(box(PAIR), faults, 1e-4, form="potential-energy")
        header[width] = found.header
        assert set(found["sideband_of"]) == {"", "pinion"}
    assert header[20]["mean_deflection_m"] > 1.01 * header[12]["mean_deflection_m"]


def test_even_wear_shifts_the_mean_only():
    faults = ["wear:1:pinion:all:0.02mm"]
    found = expected_signature(box(PAIR), faults, form="potential-energy")
    assert found.header["mean_deflection_m"] > 20e-6
    assert set(found["sideband_of"]) == {""}


def test_errors_of_helical_gears():
    stage = replace(PAIR, helix_angle_deg=12.0)
    found = expected_signature(box(stage), ["pitch:1:pinion:3:10um"], 1e-3)
    assert set(found["sideband_of"]) == {"", "pinion"}
    assert np.isfinite(found["acceleration_ms2"]).all()


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("excentricity:1:pinion:all:20um", "did you mean eccentricity"),
        ("eccentricity:2:pinion:all:20um", "stage 2 does not exist"),
        ("pitch:1:pinion:10:20um", "tooth 10 does not exist"),
    ],
)
def test_refusals(fault, words):
    with pytest.raises(ArgumentError, match=words):
        expected_signature(box(), [fault])


def test_a_method_of_the_equation_alone_takes_no_moved_flanks():
    with pytest.raises(ArgumentError, match="stage 1 move the flanks too; leave method out"):
        expected_signature(box(), ["pitch:1:pinion:4:6um"], method="harmonic balance")


def test_an_eccentric_gear_beside_a_crack_of_its_mate():
    """Corners of what the crack takes stay where they are while the contact moves about them."""
    faults = ["eccentricity:1:pinion:all:20um", "crack:1:gear:3:30%"]
    coarse, fine = (
        expected_signature(box(PAIR), faults, tolerance, max_hz=3000.0)
        for tolerance in (1e-6, 1e-12)
    )
    lines = [own["acceleration_ms2"] * np.exp(1j * own["phase_rad"]) for own in (coarse, fine)]
    assert np.linalg.norm(lines[0] - lines[1]) < 1e-7 * np.linalg.norm(lines[1])


def test_a_missing_tooth_by_the_energy_of_the_teeth():
    """A mesh period among those of its contact in which nothing differs does no harm."""
    stage = replace(PAIR, pinion_teeth=25, gear_teeth=59, module_mm=3.0, face_width_mm=19.0)
    found = expected_signature(
        box(stage), ["missing:1:gear:2"], max_hz=2000.0, form="potential-energy"
    )
    assert set(found["sideband_of"]) == {"", "gear"}
    assert found.header["error_estimate"] < 1e-6


@pytest.mark.parametrize(
    ("rpm", "damping_ratio", "parted"),
    [(3000.0, 0.1, 4), (36_000.0, 0.1, 5), (60_000.0, 0.1, 6), (30_000.0, 0.05, 1)],
)
def test_teeth_part_where_the_force_between_them_falls_to_nothing(rpm, damping_ratio, parted):
    """While a tooth out of its place meets its mate, or as the mesh swings on after it."""
    stage, teeth, points = replace(SMALL, damping_ratio=damping_ratio), 9, 200
    made = Machine(name="box", operating=(replace(POINT, speed_rpm=rpm),), stages=(stage,))
    mechanics = stage_mechanics(made, 1)
    phase = (np.arange(teeth * points) + 0.5) / points
    stiffness, forces = mechanics.stiffness.at(phase), []
    for size in (0.0, 1e-6):
        at = parabolic_error("pitch", size, 4, teeth)
        error = np.array([at(own) for own in phase.tolist()])
        z = steps_in_time(stiffness, error, mechanics, teeth / mechanics.mesh_frequency_hz)
        after, step = np.roll(z, -1), 1 / (points * mechanics.mesh_frequency_hz)
        damped = mechanics.damping_ns_per_m * (after - z) / step
        forces.append(stiffness * (0.5 * (z + after) - error) + damped)
    added = forces[1] - forces[0]
    critical_um = np.min(forces[0][added < 0] / -added[added < 0])
    assert int(phase[np.argmin(forces[0] + critical_um * added)]) == parted
    for share in (0.95, 1.05):
        fault = f"pitch:1:pinion:4:{share * critical_um:.6g}um"
        found = expected_signature(made, [fault], 1e-4, max_hz=6 * mechanics.mesh_frequency_hz)
        assert found.header["contact_lost"] == (share > 1)
