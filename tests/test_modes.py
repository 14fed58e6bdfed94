"""Natural vibrations of whole machines: published systems, laws, and an independent formulation."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import eigh

import gearmon
from gearmon.cli import main
from gearmon.errors import GearmonError
from gearmon.gears.assembly import drive_train

POINT = {"speed_rpm": 1500.0, "torque_nm": 100.0}
PAIR = {
    "kind": "parallel",
    "pinion_teeth": 23,
    "gear_teeth": 57,
    "module_mm": 2.5,
    "face_width_mm": 28.0,
}
# Lin and Parker 1999, table 2: natural frequencies [Hz] by the number of planets
PUBLISHED = {
    3: {
        "rotational": [1475.7, 1930.3, 2658.3, 7462.8, 11775.3],
        "translational": [743.2, 1102.4, 1896.0, 2276.4, 6986.3, 9647.9],
        "planet": [],
    },
    4: {
        "rotational": [1536.6, 1970.6, 2625.7, 7773.6, 13071.1],
        "translational": [727.0, 1091.0, 1892.8, 2342.5, 7189.9, 10437.6],
        "planet": [1808.2, 5963.8, 6981.7],
    },
}


def planetary(planets, teeth=(24, 30, 84), **more):
    """The set of Lin and Parker: a helicopter's."""
    sun, planet, ring = (2e-3 * z * math.cos(math.radians(24.6)) for z in teeth)
    centres = 2e-3 * (teeth[0] + teeth[1])
    stage = {
        "kind": "planetary",
        **dict(zip(("sun_teeth", "planet_teeth", "ring_teeth"), teeth, strict=True)),
        "planets": planets,
        "module_mm": 4.0,
        "pressure_angle_deg": 24.6,
        "mesh_stiffness_n_per_m": 5e8,
        "ring_mesh_stiffness_n_per_m": 5e8,
        "mass_sun_kg": 0.4,
        "mass_ring_kg": 2.35,
        "mass_carrier_kg": 5.43,
        "mass_planet_kg": 0.66,
        "inertia_sun_kgm2": 0.39 * sun**2,
        "inertia_ring_kgm2": 3.0 * ring**2,
        "inertia_carrier_kgm2": 6.29 * centres**2,
        "inertia_planet_kgm2": 0.61 * planet**2,
        "fixed_support_n_per_m": 1e8,
        "fixed_torsion_nm_per_rad": 1e9 * ring**2,
    }
    names = ({"name": "sun", "shaft": 1}, {"name": "carrier", "shaft": 2})
    held = [*names, {"name": "pins", "planet_stage": 1}]
    bearings = [own | {"stiffness_n_per_m": 1e8} for own in held]
    return {"operating": POINT, "stage": [stage | more], "bearing": bearings}


@pytest.mark.parametrize("planets", PUBLISHED)
@pytest.mark.parametrize("driving", ["sun", "carrier"])
def test_published_planetary_sets(planets, driving):
    found = gearmon.modes(planetary(planets, driving=driving))
    assert [mode.type for mode in found.rows].count("rigid body") == 1
    for kind, expected in PUBLISHED[planets].items():
        times = {"rotational": 1, "translational": 2, "planet": planets - 3}[kind]
        own = [mode for mode in found.rows if mode.type == kind]
        frequencies = [mode.frequency_hz for mode in own]
        np.testing.assert_allclose(frequencies, np.repeat(expected, times), rtol=5e-4)
        assert all(getattr(mode, kind) == pytest.approx(1, abs=1e-9) for mode in own)


@pytest.mark.parametrize("teeth", [(24, 30, 84), (25, 29, 83), (26, 28, 82)])
def test_harmonics_drive_what_their_phases_allow(teeth):
    # Parker and Lin 2004: by mod(l z_s, N) harmonic l drives rotation, translation or planets
    found = gearmon.modes(planetary(4, teeth), highest_rpm=1e5)
    kinds = {mode.number: mode.type for mode in found.rows}
    allowed = ("rotational", "translational", "planet", "translational")
    assert len(found.campbell) > 100
    for own in found.campbell:
        is_driven = allowed[own.harmonic * teeth[0] % 4] == kinds[own.mode]
        assert (own.in_phase > 1e-6) == is_driven
        if is_driven:
            # forces go round as a cosine in translation: half of their squares act together
            part = math.sqrt(0.5) if kinds[own.mode] == "translational" else 1.0
            assert own.in_phase == pytest.approx(part, rel=1e-3)
        frequency = own.harmonic * found.mesh_orders[0] * own.speed_rpm / 60
        assert frequency == pytest.approx(own.frequency_hz)


def test_meetings_are_drawn_on_the_harmonics_that_make_them():
    from gearmon.report.expected_plots import campbell_figure

    found = gearmon.modes({"operating": POINT, "stage": [PAIR]})
    ax = campbell_figure(found).axes[0]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("speed of shaft 1 in rpm", "frequency in Hz")
    rays = [line for line in ax.lines if line.get_label() == "harmonics of mesh 1"]
    assert len(rays) == found.harmonics
    for harmonic, line in enumerate(rays, start=1):
        # 23 teeth at so many turns a minute
        top_hz = harmonic * 23 * found.highest_rpm / 60
        assert line.get_xydata() == pytest.approx(np.array([[0, 0], [found.highest_rpm, top_hz]]))
    marks = {tuple(line.get_xydata()[0]) for line in ax.lines if line.get_marker() == "o"}
    assert marks == {(own.speed_rpm, own.frequency_hz) for own in found.campbell}


def test_marks_of_meetings_are_larger_the_more_a_mesh_drives_its_mode():
    """Empty and smallest where the forces of the planets cancel."""
    from gearmon.report.expected_plots import campbell_figure

    found = gearmon.modes(planetary(4))
    marks = [line for line in campbell_figure(found).axes[0].lines if line.get_marker() == "o"]
    assert len({own.drives for own in found.campbell}) == 2
    for line, own in zip(marks, found.campbell, strict=True):
        driven = math.sqrt(own.mesh_share) * own.in_phase if own.drives else 0.0
        assert line.get_markersize() == pytest.approx(2.5 + 6 * driven)
        assert (line.get_markerfacecolor() == "white") == (not own.drives)


def test_the_headline_tells_of_the_meeting_nearest_to_an_operating_speed():
    found = gearmon.modes({"operating": POINT, "stage": [PAIR]})
    first = next(own for own in found.campbell if own.drives)

    def told(*ratios, speed=1500.0):
        campbell = tuple(
            replace(first, speed_rpm=speed * ratio, harmonic=number)
            for number, ratio in enumerate(ratios, 1)
        )
        return replace(found, campbell=campbell, speeds_rpm=(speed,)).headline()

    nearest = "nearest to 1500 rpm: harmonic {} of mesh 1 meets mode {} "
    assert nearest.format(2, first.mode) in told(0.5, 0.9, 1.3)
    assert nearest.format(3, first.mode) in told(0.5, 0.7, 1.3)
    # by ratio: twice the speed is as far as half of it
    assert nearest.format(1, first.mode) in told(0.55, 2.0)
    assert nearest.format(2, first.mode) in told(0.45, 2.0)
    assert "nearest" not in told()


def torsional(sections, discs, inertia, **places):
    """A train that twists only, its gears of ratio 1 as good as rigid."""
    gears = {"pinion_teeth": 30, "gear_teeth": 30, "mesh_stiffness_n_per_m": 1e13}
    bodies = {f"inertia_{gear}_kgm2": inertia for gear in ("pinion", "gear")}
    bodies |= {f"mass_{gear}_kg": 1.0 for gear in ("pinion", "gear")}
    return {
        "operating": POINT,
        "stage": [PAIR | gears | bodies | places],
        "shaft": [
            {"shaft": shaft, "length_mm": 100.0, "torsional_stiffness_nm_per_rad": twist}
            for shaft, twist in sections
        ],
        "disc": [
            {
                "name": f"{shaft} at {place}",
                "shaft": shaft,
                "inertia_kgm2": own,
                "position_mm": place,
            }
            for shaft, place, own in discs
        ],
    }


@pytest.mark.parametrize(
    ("machine", "expected"),
    [
        (
            torsional(
                [(1, 1e4), (2, 5e3), (2, 5e3)],
                [(1, 0, 4e-4), (2, 0, 7e-4), (2, 200, 7e-4)],
                2.5e-5,
                position_pinion_mm=100.0,
                position_gear_mm=100.0,
            ),
            [425.4, 634.1, 3247.2],
        ),
        (
            torsional(
                [(1, 12e3), (1, 12e3), (2, 14e3), (2, 10e3)],
                [(1, 0, 3.5e-3), (1, 100, 3.5e-3), (2, 100, 0.15), (2, 200, 0.05)],
                1.75e-3,
                position_pinion_mm=200.0,
                position_gear_mm=0.0,
            ),
            [81.21, 141.21, 378.95, 536.36],
        ),
    ],
)
def test_published_torsional_systems(machine, expected):
    # Friswell, Penny, Garvey and Lees 2010; the last mode is that of the teeth
    found = gearmon.modes(machine)
    np.testing.assert_allclose(found.frequencies_hz[1:-1], expected, rtol=1.2e-4)
    assert found.frequencies_hz[0] == 0


def bent():
    """Two shafts that twist and bend in elastic bearings, with a geared pair between."""
    shaft = {"bending_stiffness_nm2": 25e3, "diameter_mm": 40.0, "length_mm": 500.0}
    bearings = [
        {"name": f"{s}{p}", "shaft": s, "position_mm": p, "stiffness_n_per_m": k}
        for s, p, k in ((1, 20.0, 1e8), (1, 400.0, 2e8), (2, 50.0, 3e8), (2, 500.0, 1.5e8))
    ]
    placed = {"position_pinion_mm": 150.0, "position_gear_mm": 330.0, "axis_angle_deg": 40.0}
    return {
        "operating": POINT,
        "stage": [PAIR | placed],
        "shaft": [shaft | {"shaft": 1}, shaft | {"shaft": 2}],
        "bearing": bearings,
        "disc": [{"name": "load", "shaft": 2, "inertia_kgm2": 0.05, "mass_kg": 4.0}],
    }


def by_polynomials(machine, count=40):
    """Natural frequencies [Hz] by Ritz: Legendre polynomials along each shaft, and the velocities
    of both flanks where they touch."""
    known = gearmon.load_machine(machine)
    train = drive_train(known)
    steel = 206e9 / 2.6, math.pi / 32 * 0.04**4, 7850.0, math.pi / 4 * 0.04**2
    length, shear, polar, density, area = 0.5, *steel
    at, weights = np.polynomial.legendre.leggauss(count + 10)
    basis = np.polynomial.legendre.legvander

    def values(place, order=0):
        made = np.eye(count)
        for _ in range(order):
            made = np.polynomial.legendre.legder(made) * 2 / length
        return basis(2 * np.atleast_1d(place) / length - 1, made.shape[0] - 1) @ made

    def integral(order):
        rows = values(length * (at + 1) / 2, order)
        return rows.T @ (weights[:, None] * length / 2 * rows)

    def spot(shaft, kind, place):
        row = np.zeros((6, count))
        row[3 * shaft + kind] = values(1e-3 * place)[0]
        return row.ravel()

    mass, stiffness = np.zeros((2, 6 * count, 6 * count))
    for shaft in range(2):
        for kind in range(3):
            own = slice((3 * shaft + kind) * count, (3 * shaft + kind + 1) * count)
            heavy, held = (area, 25e3 * integral(2)) if kind < 2 else (polar, None)
            mass[own, own] = density * heavy * integral(0)
            stiffness[own, own] = shear * polar * integral(1) if held is None else held
    for bearing in known.bearings:
        for kind in range(2):
            row = spot(bearing.shaft - 1, kind, bearing.position_mm)
            stiffness += bearing.stiffness_n_per_m * np.outer(row, row)
    # gears as steel discs of the mean of tip and root diameter, x = 0
    gears = []
    for shaft, (teeth, place) in enumerate(((23, 150.0), (57, 330.0))):
        radius = 0.5e-3 * 2.5 * (teeth - 0.25)
        heavy = 7850 * math.pi * radius**2 * 0.028
        rows = [spot(shaft, kind, place) for kind in range(3)]
        gears.append(rows)
        for row, own in zip(rows, (heavy, heavy, heavy * radius**2 / 2), strict=True):
            mass += own * np.outer(row, row)
    for kind, own in enumerate((4.0, 4.0, 0.05)):
        row = spot(1, kind, 500.0)
        mass += own * np.outer(row, row)
    # the pinion turns anticlockwise; the flanks touch at the pitch point
    g, alpha = math.radians(40.0), math.radians(20.0)
    towards = np.array([math.cos(g), math.sin(g)])
    across = np.array([-towards[1], towards[0]])
    push = math.cos(alpha) * across + math.sin(alpha) * towards
    closing = np.zeros(6 * count)
    for side, rows, arm in zip((1, -1), gears, (28.75e-3, -71.25e-3), strict=True):
        spun = arm * np.array([-towards[1], towards[0]])
        closing += side * sum(push[k] * (rows[k] + spun[k] * rows[2]) for k in range(2))
    stiffness += train.meshes(1)[0].stiffness[0, 0] * np.outer(closing, closing)
    squares = eigh(stiffness, mass, eigvals_only=True)
    return np.sqrt(squares.clip(0)) / (2 * math.pi)


def test_against_polynomials_along_the_shafts():
    found = gearmon.modes(bent()).frequencies_hz
    expected = by_polynomials(bent())
    assert expected[0] < 1
    assert found[0] == 0
    np.testing.assert_allclose(found[1:16], expected[1:16], rtol=5e-3)
    # and no mode is told for which the shafts are cut too coarsely
    assert len(found) > 20
    away = np.abs(found[1:, None] / expected[1:] - 1).min(axis=1)
    assert away.max() < 0.01


def test_shear_of_a_short_shaft():
    # a disc of 40 kg mid-way between rigid supports: w = F L^3/48EI + F L/4 kappa G A
    shaft = {"shaft": 1, "length_mm": 120.0, "diameter_mm": 40.0, "density_kgm3": 0.0}
    disc = {"name": "disc", "shaft": 1, "inertia_kgm2": 0.1, "mass_kg": 40.0, "position_mm": 60.0}
    pair = PAIR | {"position_pinion_mm": 0.0}
    found = gearmon.modes({"operating": POINT, "stage": pair, "shaft": shaft, "disc": disc})
    area, second = math.pi / 4 * 0.04**2, math.pi / 64 * 0.04**4
    kappa, shear = 6 * 1.3 / (7 + 6 * 0.3), 206e9 / 2.6
    soft = 0.12**3 / (48 * 206e9 * second) + 0.12 / (4 * kappa * shear * area)
    expected = math.sqrt(1 / (40 * soft)) / (2 * math.pi)
    near = [m.frequency_hz for m in found.rows if m.type == "translational"]
    np.testing.assert_allclose(near, [expected] * 2, rtol=1e-9)


@pytest.mark.parametrize("machine", [bent(), planetary(4)], ids=["shafts", "planets"])
def test_strain_shares_are_what_stiffness_does(machine):
    # d ln f^2/d ln k is the share of strain energy (Rayleigh)
    key, step = "mesh_stiffness_n_per_m", 1e-4
    mesh = drive_train(gearmon.load_machine(machine)).meshes(1)[0]
    plain, stiffer = (
        gearmon.modes(
            machine | {"stage": [machine["stage"][0] | {key: mesh.stiffness[0, 0] * factor}]}
        )
        for factor in (1.0, 1 + step)
    )
    for mode, other in zip(plain.rows[1:20], stiffer.rows[1:20], strict=True):
        share = mode.strain_energy[mesh.part]
        grown = 2 * math.log(other.frequency_hz / mode.frequency_hz) / math.log1p(step)
        assert grown == pytest.approx(share, abs=2e-4)
        assert sum(mode.strain_energy.values()) == pytest.approx(1)
        assert mode.rotational + mode.translational + mode.planet == pytest.approx(1)


def test_every_part_damps_a_mode_by_its_share_of_the_strain():
    """Half the frequency times damping over stiffness: as told, 1e-5 s where nothing is."""
    shafts = [{"shaft": n, "length_mm": 200.0, "diameter_mm": 30.0} for n in (1, 2)]
    held = [
        {"name": f"b{n}", "shaft": shaft, "stiffness_n_per_m": 1e8}
        for n, shaft in enumerate((1, 1, 2, 2))
    ]
    held[0]["damping_ns_per_m"] = 800.0
    pair = PAIR | {"mesh_stiffness_n_per_m": 4e8, "damping_ns_per_m": 2e3}
    found = gearmon.modes({"operating": POINT, "stage": [pair], "shaft": shafts, "bearing": held})
    told_s = {"mesh 1 pinion-gear": 2e3 / 4e8, "bearing 1 b0": 800.0 / 1e8}
    assert len(found.rows) > 10
    for mode in found.rows:
        damped_s = sum(own * told_s.get(part, 1e-5) for part, own in mode.strain_energy.items())
        assert mode.damping_ratio == pytest.approx(math.pi * mode.frequency_hz * damped_s)


def test_ball_bearings_by_hertz():
    balls = {"balls": 9, "ball_diameter_mm": 12.0, "pitch_diameter_mm": 58.0}
    held = [{"name": name, "shaft": 1} | balls for name in ("a", "b")]
    machine = {"operating": POINT, "stage": PAIR, "bearing": held}
    # a shaft without sections is rigid across its axis, as in `gearmon.simulate`
    rigid = gearmon.modes(machine)
    assert [mode.type for mode in rigid.rows] == ["rigid body", "rotational"]
    machine["shaft"] = {"shaft": 1, "length_mm": 100.0, "diameter_mm": 30.0}
    pair_force = 100.0 / (0.5 * 23 * 2.5e-3 * math.cos(math.radians(20)))
    stiffness = 13e6 * (81 * 0.012 * pair_force / 2) ** (1 / 3)
    springs = drive_train(gearmon.load_machine(machine)).springs
    held_by = [own.stiffness[0, 0] for own in springs if own.part.startswith("bearing")]
    assert held_by == pytest.approx([stiffness, stiffness])
    # without torque there is no load to tell it
    free = drive_train(gearmon.load_machine(machine | {"operating": {"speed_rpm": 1500.0}}))
    assert not [own for own in free.springs if own.part.startswith("bearing")]


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.booleans(), min_size=1, max_size=4),
    st.lists(st.tuples(st.integers(1, 5), st.booleans(), st.booleans()), max_size=6),
    st.integers(0, 2**32 - 1),
)
def test_any_train_has_modes(stages, extras, seed):
    rng = np.random.default_rng(seed)
    train = {"kind": "planetary", "sun_teeth": 18, "ring_teeth": 72, "planets": 3} | {
        "module_mm": 3.0,
        "face_width_mm": 30.0,
    }
    document = {"operating": POINT, "stage": [train if own else PAIR for own in stages]}
    for shaft, section, bearing in extras:
        shaft = min(shaft, len(stages) + 1)
        if section:
            size = {"length_mm": rng.uniform(20, 500), "diameter_mm": rng.uniform(10, 90)}
            document.setdefault("shaft", []).append({"shaft": shaft} | size)
        if bearing:
            held = {"name": "b", "shaft": shaft, "stiffness_n_per_m": 10 ** rng.uniform(6, 9)}
            document.setdefault("bearing", []).append(held)
    found = gearmon.modes(document)
    assert np.isfinite(found.frequencies_hz).all()
    assert found.rows[0].type == "rigid body"
    assert (np.diff(found.frequencies_hz) >= 0).all()
    for mode in found.rows:
        if mode.frequency_hz:
            assert sum(mode.strain_energy.values()) == pytest.approx(1, abs=1e-6)


def written(folder, *more):
    keys = "\n".join(f"{key} = {value!r}" for key, value in PAIR.items()).replace("'", '"')
    text = f"[operating]\nspeed_rpm = 1500.0\n[[stage]]\n{keys}\n" + "\n".join(more)
    (folder / "machine.toml").write_text(text)
    return str(folder / "machine.toml")


SHAFT = "[[shaft]]\nshaft = 1\nlength_mm = 100.0\ndiameter_mm = 30.0\n"


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ("position_pinion_mm = 3.0", "stage[1].position_pinion_mm = 3.0 must lie in [0, 0] mm"),
        (
            SHAFT + "bore_mm = 30.0",
            "shaft[1].bore_mm = 30.0 must lie in [0, 30) mm",
        ),
        ("[[shaft]]\nshaft = 1\nlength_mm = 9.0", "shaft[1].diameter_mm or torsional_stiffness"),
        ("[[shaft]]\nshaft = 7\nlength_mm = 9.0\ndiameter_mm = 9.0", "shaft[1].shaft = 7 must lie"),
        (
            SHAFT + '[[disc]]\nname = "m"\nshaft = 1\ninertia_kgm2 = 1.0\nposition_mm = 101.0',
            "disc[1].position_mm = 101.0 must lie in [0, 100] mm: the length of shaft 1",
        ),
        ('[[disc]]\nname = "m"\nshaft = 1\ninertia_kgm2 = 0.0', "disc[1].inertia_kgm2 = 0.0 must"),
        (
            '[[bearing]]\nname = "b"\nshaft = 1\nballs = 9',
            "bearing[1].ball_diameter_mm is missing; give all of balls, ball_diameter_mm",
        ),
        (
            '[[bearing]]\nname = "b"\nshaft = 1\nstiffness_n_per_m = 1e8\nroller_length_mm = 9.0',
            "bearing[1].balls is missing; give all of balls, ball_diameter_mm, pitch_diameter_mm, "
            "or stiffness_n_per_m and no rolling elements",
        ),
        (
            '[[bearing]]\nname = "b"\nshaft = 1\nstiffness_n_per_m = 1e8\nroller_length_mm = -9.0',
            "bearing[1].roller_length_mm = -9.0 must lie in (0, 500] mm",
        ),
        ('[[bearing]]\nname = "b"\nshaft = 1\nstiffness_n_per_m = 1.0', "stiffness_n_per_m = 1.0"),
        ("fixed_support_n_per_m = 1e8", "it belongs to [[stage]] with kind"),
    ],
)
def test_refusals_name_file_key_and_value(tmp_path, capsys, more, told):
    assert main(["modes", written(tmp_path, more)]) == 2
    said = capsys.readouterr().err
    assert "machine.toml" in said
    assert told in said
    assert said.count("\n") == 1


def test_what_lacks_is_named():
    bare = {key: own for key, own in PAIR.items() if key != "face_width_mm"}
    with pytest.raises(GearmonError, match="face_width_mm is missing"):
        gearmon.modes({"operating": POINT, "stage": bare})
    with pytest.raises(GearmonError, match="harmonics=0 must lie"):
        gearmon.modes({"operating": POINT, "stage": PAIR}, harmonics=0)
    fixed = planetary(3, position_ring_mm=0.0)
    with pytest.raises(GearmonError, match=r"position_ring_mm = 0\.0 is for members on shafts"):
        gearmon.load_machine(fixed)


def test_new_keys_survive_a_dictionary():
    machine = gearmon.load_machine(bent())
    again = gearmon.load_machine(machine.to_dict())
    assert (again.sections, again.discs, again.bearings) == (
        machine.sections,
        machine.discs,
        machine.bearings,
    )


def test_the_command_writes_tables_and_picture(tmp_path, monkeypatch, capsys, fits_schema):
    monkeypatch.chdir(tmp_path)
    path = written(tmp_path, SHAFT)
    assert main(["modes", path, "-o", "modes.csv", "--to-rpm", "9000", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    fits_schema("modes", answer)
    assert answer["tables"] == ["modes.csv", "modes-campbell.csv"]
    assert {path.name for path in tmp_path.iterdir()} >= {"modes.csv", "modes.png"}
    rows = (tmp_path / "modes.csv").read_text().splitlines()
    assert len(rows) == len(answer["rows"]) + 1
    assert main(["modes", path]) == 0
    assert "shaft 2 is rigid" in capsys.readouterr().out


def test_a_campbell_table_without_meetings_keeps_its_header(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["modes", written(tmp_path, SHAFT), "-o", "slow.csv", "--to-rpm", "0.01"]) == 0
    assert "meets" not in capsys.readouterr().out
    (header,) = (tmp_path / "slow-campbell.csv").read_text().splitlines()
    assert header == "speed_rpm,mode,frequency_hz,stage,harmonic,mesh_share,in_phase"


def test_modes_of_an_operating_point_are_those_of_a_machine_with_that_one_alone():
    """Ball bearings are the stiffer the more they carry."""
    balls = {"balls": 9, "ball_diameter_mm": 12.0, "pitch_diameter_mm": 58.0}
    held = [{"name": name, "shaft": 1} | balls for name in ("a", "b")]
    points = [{"speed_rpm": 1500.0, "torque_nm": own, "share": 0.5} for own in (10.0, 400.0)]
    rest = {"stage": PAIR, "bearing": held}
    both = [gearmon.modes({"operating": points} | rest, operating=n) for n in (0, 1)]
    for found, point in zip(both, points, strict=True):
        alone = gearmon.modes({"operating": point | {"share": 1.0}} | rest)
        np.testing.assert_array_equal(found.frequencies_hz, alone.frequencies_hz)
    assert both[1].frequencies_hz[-1] != pytest.approx(both[0].frequencies_hz[-1], rel=1e-3)


@pytest.mark.parametrize("points", [1, 2, 3])
def test_an_operating_point_that_the_machine_lacks_is_refused(points):
    own = [
        {"speed_rpm": 1500.0 + n, "torque_nm": 100.0, "share": 1 / points} for n in range(points)
    ]
    gearmon.modes({"operating": own, "stage": PAIR}, operating=points - 1)
    for wrong in (-1, points, points + 1):
        with pytest.raises(GearmonError, match=f"operating={wrong} must lie in"):
            gearmon.modes({"operating": own, "stage": PAIR}, operating=wrong)
