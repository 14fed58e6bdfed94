"""Machine files: what is read, and what is refused in one clear line."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearmon.errors import MachineFileError
from gearmon.machine import ParallelStage, PlanetaryStage, load_machine
from gearmon.machine.fields import key_lines
from gearmon.machine.parts import TABLES

EXAMPLES = sorted((Path(__file__).parent.parent / "signatures").glob("*.toml"))

PAIR = """name = "pair"
[operating]
speed_rpm = 1460.0
[[stage]]
kind = "parallel"
pinion_teeth = 26
gear_teeth = 53
"""
PLANETARY = """[operating]
speed_rpm = 1800.0
[[stage]]
kind = "planetary"
sun_teeth = 20
ring_teeth = 100
planets = 4
"""
BEARING = """[[bearing]]
name = "drive end"
shaft = 1
balls = 9
ball_diameter_mm = 7.94
pitch_diameter_mm = 39.04
"""


@pytest.fixture
def write(tmp_path):
    def _write(content: str | bytes) -> Path:
        path = tmp_path / "box.toml"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return _write


def refusal(path: Path | str) -> str:
    """Return the message by which `path` is refused, after checking that it is one line."""
    with pytest.raises(MachineFileError) as caught:
        load_machine(path)
    message = str(caught.value)
    assert message.isprintable()
    return message


# --- what is read


def test_pair_is_read_with_defaults(write):
    machine = load_machine(write(PAIR))
    (stage,) = machine.stages
    assert machine.name == "pair"
    assert machine.path.endswith("box.toml")
    assert machine.shaft_count == 2
    assert machine.operating[0].shaft1_hz == pytest.approx(1460 / 60)
    assert machine.operating[0].torque_nm is None
    assert isinstance(stage, ParallelStage)
    assert (stage.kind, stage.pinion_teeth, stage.gear_teeth) == ("parallel", 26, 53)
    assert stage.module_mm is None
    assert stage.elastic_modulus_pinion_pa == 206e9
    assert machine.notes == ()


def test_name_defaults_to_that_of_the_file(write):
    assert load_machine(write(PAIR.replace('name = "pair"\n', ""))).name == "box"


def test_whole_numbers_serve_for_lengths(write):
    (stage,) = load_machine(write(PAIR + "module_mm = 2\n")).stages
    assert stage.module_mm == 2.0
    assert isinstance(stage.module_mm, float)


def test_planet_teeth_are_derived_and_it_says_so(write):
    machine = load_machine(write(PLANETARY))
    (stage,) = machine.stages
    assert isinstance(stage, PlanetaryStage)
    assert stage.planet_teeth == 40
    assert (stage.fixed, stage.driving, stage.driven) == ("ring", "sun", "carrier")
    assert machine.notes == ("stage 1: planet_teeth = 40 taken from (ring_teeth - sun_teeth) / 2",)


def test_unusual_planetary_teeth_are_noted_not_refused(write):
    text = PLANETARY.replace("100", "101") + "planet_teeth = 40\n"
    first, second = load_machine(write(text)).notes
    assert first.startswith("stage 1: ring_teeth = 101 is 1 more than sun + 2 planet")
    assert "121 teeth is not divisible by 4 planets" in second


def test_duty_cycle_with_shares(write):
    text = PAIR.replace(
        "[operating]", "[[operating]]\nspeed_rpm = 900\nshare = 0.25\n[[operating]]\nshare = 0.75"
    )
    machine = load_machine(write(text))
    assert [(p.speed_rpm, p.share) for p in machine.operating] == [(900.0, 0.25), (1460.0, 0.75)]


@pytest.mark.parametrize(("speeds", "taken"), [((14.6, 1460), True), ((1460, 14.5), False)])
def test_speeds_a_hundredfold_apart_are_taken_and_beyond_refused(write, speeds, taken):
    several = "".join(f"[[operating]]\nspeed_rpm = {own}\n" for own in speeds)
    path = write(PAIR.replace("[operating]\nspeed_rpm = 1460.0\n", several))
    if taken:
        assert [own.speed_rpm for own in load_machine(path).operating] == list(speeds)
    else:
        assert "they go from 14.5 to 1460 1/min" in refusal(path)


def test_duty_cycle_without_shares_is_divided_equally(write):
    text = PAIR.replace("[operating]", "[[operating]]\nspeed_rpm = 900\n" * 2 + "[[operating]]")
    machine = load_machine(write(text))
    assert [p.share for p in machine.operating] == [pytest.approx(1 / 3)] * 3


def test_bearings_and_sensors(write):
    text = (
        PAIR
        + BEARING
        + '[[sensor]]\ncolumn = 2\nunit = "g"\nsensitivity = 0.1\nposition = "top"\n'
        + '[[sensor]]\ncolumn = "tach"\nkind = "tacho"\nshaft = 2\npulses_per_turn = 60\n'
    )
    machine = load_machine(write(text))
    assert machine.bearings[0].shaft == 1
    assert machine.bearings[0].rotating == "inner"
    first, second = machine.sensors
    assert (first.column, first.unit, first.sensitivity, first.kind) == (2, "g", 0.1, "vibration")
    assert (second.column, second.kind, second.shaft, second.pulses_per_turn) == (
        "tach",
        "tacho",
        2,
        60,
    )


@pytest.mark.parametrize(
    "content",
    [
        PAIR.encode("utf-8-sig"),
        PAIR.replace("\n", "\r\n").encode(),
        PAIR.replace(" = ", "=").encode(),
    ],
    ids=["byte order mark", "Windows line ends", "no spaces"],
)
def test_text_variants(write, content):
    assert load_machine(write(content)).stages[0].gear_teeth == 53


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_examples_load_without_notes_on_their_data(path):
    machine = load_machine(path)
    assert machine.stages
    assert machine.notes == ()


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_a_machine_is_made_again_of_its_dictionary(path):
    known = load_machine(path)
    again = load_machine(known.to_dict())
    for part in (*TABLES.values(), "name"):
        assert getattr(again, part) == getattr(known, part)


# --- what is refused

REFUSED = {
    "misspelt key": (PAIR + "modul_mm = 2\n", "box.toml:8: stage[1].modul_mm is not a known key"),
    "nearest key": (PAIR + "modul_mm = 2\n", "did you mean module_mm?"),
    "misspelt table": (PAIR.replace("[[stage]]", "[[stages]]"), "did you mean stage?"),
    "key of another kind": (
        PAIR + "sun_teeth = 9\n",
        'belongs to [[stage]] with kind = "planetary"',
    ),
    "key of another table": ("speed_rpm = 9\n" + PAIR, "belongs to [operating]"),
    "unknown key": ("colour = 1\n" + PAIR, "colour is not a known key; known are name, operating"),
    "key with a line break": (PAIR + '"a\\nb" = 1\n', "is not a known key"),
    "negative": (
        PAIR + "module_mm = -2\n",
        ":8: stage[1].module_mm = -2 must lie in [0.02, 200] mm",
    ),
    "metres": (PAIR + "module_mm = 0.002\n", "= 0.002 must lie in [0.02, 200] mm"),
    "text for a number": (
        PAIR + 'module_mm = "2 mm"\n',
        '= "2 mm" must be a number, without quotes',
    ),
    "truth for a number": (PAIR + "module_mm = true\n", "= true must be a number"),
    "list for a number": (PAIR + "module_mm = [2.0]\n", "must be a number"),
    "date for a number": (PAIR + "module_mm = 2020-01-01\n", "must be a number"),
    "nan": (PAIR + "module_mm = nan\n", "= nan must lie in"),
    "infinity": (PAIR + "force_n = inf\n", "= inf must lie in (0, 1e+10] N"),
    "huge integer": (PAIR + f"module_mm = {'9' * 400}\n", "module_mm = an integer of more than"),
    "unreadable integer": (PAIR + f"module_mm = {'9' * 5000}\n", "integer of thousands of digits"),
    "fractional teeth": (
        PAIR.replace("26", "26.5"),
        ":6: stage[1].pinion_teeth = 26.5 must be a whole",
    ),
    "teeth with a point": (PAIR.replace("26", "26.0"), "= 26.0 must be a whole number"),
    "truth for teeth": (PAIR.replace("26", "true"), "= true must be a whole number"),
    "no teeth": (PAIR.replace("26", "0"), "= 0 must lie in [5, 2000]"),
    "too many teeth": (PAIR.replace("26", "26000"), "= 26000 must lie in [5, 2000]"),
    "missing teeth": (
        PAIR.replace("gear_teeth = 53\n", ""),
        ":4: stage[1] lacks gear_teeth; write",
    ),
    "missing kind": (PAIR.replace('kind = "parallel"\n', ""), "lacks kind; write kind ="),
    "unknown kind": (PAIR.replace("parallel", "bevel"), '.kind = "bevel" must be "parallel" or'),
    "kind as a number": (PAIR.replace('"parallel"', "1"), ".kind = 1 must be"),
    "no stage": ("[operating]\nspeed_rpm = 9\n", "lacks a stage; write [[stage]]"),
    "single brackets": (
        PAIR.replace("[[stage]]", "[stage]"),
        ":4: stage must be a table: write [[stage]]",
    ),
    "too many stages": (PAIR + PAIR[PAIR.index("[[") :] * 30, "stage is given 31 times"),
    "no operating point": (
        PAIR.replace("[operating]\nspeed_rpm = 1460.0\n", ""),
        "lacks an operating",
    ),
    "operating is a number": (
        "operating = 9\n" + PAIR[PAIR.index("[[") :],
        "operating must be a table",
    ),
    "no speed": (PAIR.replace("speed_rpm = 1460.0\n", ""), "operating lacks speed_rpm; write for"),
    "speed zero": (
        PAIR.replace("1460.0", "0"),
        "operating.speed_rpm = 0 must lie in (0, 1e+06] rpm",
    ),
    "negative torque": (
        PAIR.replace("1460.0", "1\ntorque_nm = -1"),
        "torque_nm = -1 must lie in [0,",
    ),
    "shares not 1": (
        PAIR.replace("1460.0", "1\nshare = 0.9"),
        "operating.share must sum to 1 over all operating points; the sum is 0.9",
    ),
    "shares by halves": (
        PAIR.replace("[operating]", "[[operating]]\nspeed_rpm = 9\nshare = 0.5\n[[operating]]"),
        ":5: operating[2] lacks share",
    ),
    "pressure angle in radians": (PAIR + "pressure_angle_deg = 0.35\n", "must lie in [10, 35] deg"),
    "helix of 45 degrees": (PAIR + "helix_angle_deg = 45\n", "must lie in (-45, 45) deg"),
    "spur contact ratio": (
        PAIR + "contact_ratio = 0.9\n",
        "must lie in [1, 6]: below 1 no",
    ),
    "centre distance": (
        PAIR + "module_mm = 2\ncentre_distance_mm = 158\n",
        ":9: stage[1].centre_distance_mm = 158.0 must lie in [74.2357, 96.9078] mm",
    ),
    "bore": (
        PAIR + "module_mm = 2\nbore_diameter_pinion_mm = 47\n",
        "bore_diameter_pinion_mm = 47.0 must lie in [0, 47) mm: less than the root diameter",
    ),
    "name is a number": (PAIR.replace('"pair"', "1"), ":1: name = 1 must be one line of text"),
    "name of two lines": (PAIR.replace("pair", "a\\nb"), "must be one line of text"),
    "ring teeth": (
        PLANETARY.replace("100", "105") + "planet_teeth = 40\n",
        ":6: stage[1].ring_teeth = 105 must lie in [97, 103]: sun + 2 planet = 100",
    ),
    "planets not derivable": (PLANETARY.replace("100", "101"), "is not twice a tooth count"),
    "planets overlap": (PLANETARY.replace("= 4", "= 7"), "planets = 7 is more than fits"),
    "unknown member": (PLANETARY + 'fixed = "rng"\n', 'did you mean "ring"?'),
    "driving is fixed": (
        PLANETARY + 'driving = "ring"\n',
        'driving = "ring" is also the fixed member',
    ),
    "no such shaft": (
        PAIR + BEARING.replace("shaft = 1", "shaft = 3"),
        "shaft = 3 must lie in [1, 2]",
    ),
    "bearing nowhere": (
        PAIR + BEARING.replace("shaft = 1\n", ""),
        ":8: bearing[1].shaft or planet_stage must be given",
    ),
    "bearing of no planets": (
        PAIR + BEARING.replace("shaft", "planet_stage"),
        "planet_stage = 1 must be the number of a planetary stage (none here)",
    ),
    "too many balls": (
        PAIR + BEARING.replace("= 9", "= 16"),
        "16 must lie in [1, 15]: more do",
    ),
    # what is missing has no line of its own: that of its table is told
    "half a bearing": (
        PAIR + BEARING.replace("balls = 9\n", ""),
        ":8: bearing[1].balls is missing; give all of balls",
    ),
    "balls too large": (
        PAIR + BEARING.replace("7.94", "39.04"),
        "must lie in [0, 39.04) mm: less than pitch_diameter_mm",
    ),
    "column zero": (PAIR + "[[sensor]]\ncolumn = 0\n", "column = 0 must be a column name"),
    "unit": (
        PAIR + '[[sensor]]\ncolumn = "a"\nunit = "parsec"\n',
        'sensor[1].unit = "parsec" must be a known unit: m/s2, g',
    ),
    "column twice": (PAIR + '[[sensor]]\ncolumn = "a"\n' * 2, "is also the column of sensor[1]"),
    "sensor kind": (PAIR + '[[sensor]]\ncolumn = 1\nkind = "taco"\n', 'did you mean "tacho"?'),
    "not TOML": (PAIR + "module_mm 2\n", "box.toml:8:11: not valid TOML"),
    "decimal comma": (PAIR + "module_mm = 2,5\n", "(decimal numbers take a point)"),
    "key twice": (PAIR + "gear_teeth = 9\n", "box.toml:8:15: not valid TOML: this key stands here"),
    "table twice": (PAIR + "[operating]\n", "a list of them takes [[table]]"),
    "unclosed text": (PAIR + 'name = "a', "box.toml:8:"),
    "unclosed list": (PAIR + "x = [1,", "not valid TOML"),
    "deep nesting": ("x = " + "[" * 5000, "box.toml"),
    "comma-separated values": ("a1,a2\n1.0,2.0\n", "box.toml:1:3: not valid TOML"),
    "empty": ("", "is empty; a machine file has [operating] and [[stage]]"),
    "comments only": ("# nothing\n", "is empty"),
    "binary": (b"\x7fELF\0\1", "is a binary file"),
    "Latin-1": (PAIR.encode() + b"# \xe9\n", "box.toml:8: byte 0xe9 is not UTF-8"),
    "UTF-16": (PAIR.encode("utf-16"), "is UTF-16 text; save it as UTF-8"),
    "large": (b"#" * (2 << 20), "has 2.1 MB; a machine file is a short text"),
}


@pytest.mark.parametrize(("content", "expected"), REFUSED.values(), ids=REFUSED.keys())
def test_refused_in_one_line(write, content, expected):
    assert expected in refusal(write(content))


def test_missing_file(tmp_path):
    assert refusal(tmp_path / "none.toml").endswith("none.toml: no such file")


def test_folder(tmp_path):
    assert "is a folder" in refusal(tmp_path)


def test_impossible_name():
    assert "is not the name of a file" in refusal("a\0b")


def test_line_numbers_survive_text_of_several_lines():
    text = 'a = """\n[[stage]]\nb = 1\n"""\n[[stage]]\nb = 1\n[[stage]]\n"b" = 2\n[t]\nc.d = 1\n'
    assert key_lines(text) == {"a": 1, "stage[1]": 5, "stage[1].b": 6, "stage[2]": 7} | {
        "stage[2].b": 8,
        "t": 9,
    }


@given(data=st.data())
def test_damaged_files_are_read_or_refused(tmp_path_factory, data):
    """Whatever is cut out of a file and put in its place: a machine, or one line."""
    text = (PLANETARY + BEARING).encode()
    start = data.draw(st.integers(0, len(text)))
    end = data.draw(st.integers(start, min(len(text), start + 12)))
    path = tmp_path_factory.mktemp("damaged") / "box.toml"
    path.write_bytes(text[:start] + data.draw(st.binary(max_size=8)) + text[end:])
    try:
        load_machine(path)
    except MachineFileError as error:
        assert str(error).isprintable()  # noqa: PT017


def test_unknown_gear_keys_are_led_to_their_neighbours(tmp_path):
    path = tmp_path / "box.toml"
    body = '[operating]\nspeed_rpm = 100.0\n[[stage]]\nkind = "parallel"\n'
    body += "pinion_teeth = 26\ngear_teeth = 53\n"
    for line, guess in (
        ("tip_diametre_pinion_mm = 56.0", "tip_diameter_pinion_mm"),
        ("rim_thickness_gera_mm = 56.0", "rim_thickness_gear_mm"),
        ("aplication_factor = 1.2", "application_factor"),
    ):
        path.write_text(body + line + "\n", encoding="utf-8")
        with pytest.raises(MachineFileError, match=f"did you mean {guess}"):
            load_machine(path)
    path.write_text(body + "rim_thickness_ring_mm = 5.0\n", encoding="utf-8")
    with pytest.raises(MachineFileError, match=r"it belongs to .*planetary"):
        load_machine(path)
