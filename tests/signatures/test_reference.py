"""The healthy reference: what it takes in, and storage that gives back what was stored."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest
from reference.simulated_machines import planetary, two_stages
from reference.small_gearbox import analysis, machine, recording, reference
from reference.synthetic_signals import white

from gearmon.errors import ArgumentError, SignatureError
from gearmon.signals.recording import Recording
from gearmon.signatures.measured.measurement import measure_signature
from gearmon.signatures.measured.reference import (
    Profile,
    WheelPattern,
    _refuse_exchanged,
    is_reference,
    machine_notes,
    make_reference,
    other_speed,
    read_reference,
    taken,
    tooth_counts,
    write_reference,
)


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    path = tmp_path_factory.mktemp("reference") / "healthy.ref"
    write_reference(reference(), path)
    return path


def same(one, other):
    """Whether two value objects agree to the last bit."""
    if isinstance(one, np.ndarray):
        known = one.dtype.kind == "f"  # a band without a bin is not a number
        return one.dtype == other.dtype and np.array_equal(one, other, equal_nan=known)
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    if hasattr(one, "__dataclass_fields__"):
        return all(same(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
    return type(one) is type(other) and one == other


def test_reading_gives_back_exactly_what_was_written(stored):
    assert is_reference(stored)
    assert same(read_reference(stored), reference())


def test_writing_twice_gives_the_same_numbers(stored, tmp_path):
    write_reference(read_reference(stored), tmp_path / "again")
    assert same(read_reference(tmp_path / "again"), reference())


def test_reference_holds_every_recording():
    known = reference()
    assert known.machine == "small gearbox"
    assert known.teeth == "23/57"
    assert known.channel_names == ("a1", "a2")
    assert known.units == ("m/s2", "m/s2")
    assert len(known.profiles) == len(known.origins) == 3
    for profile in known.profiles:
        level, scatter, heard = profile.of_families(known.family_names)
        assert level.shape == scatter.shape == heard.shape == (2, len(known.family_names))
        assert np.isfinite(level).all()
        assert (scatter > 0).all()
        assert [wheel.gear for wheel in profile.wheels] == ["pinion", "gear"]
        assert all((wheel.variance > 0).all() for wheel in profile.wheels)


def test_pattern_is_the_mean_of_the_blocks():
    signature = analysis().signature
    wheel, pattern = signature.plan.wheels[0], Profile.of(signature).wheels[0]
    np.testing.assert_allclose(pattern.amplitude, signature.lines.mean[:, wheel.lines])
    harmonics = pattern.number[pattern.mesh]
    np.testing.assert_array_equal(harmonics % 23, 0)


def test_a_mean_over_more_blocks_has_as_much_less_noise_in_it():
    """Of blocks that do not scatter at all, the noise between the lines tells the variance."""
    signature = analysis().signature
    wheel, variances = signature.plan.wheels[0], []
    for count in (20, 80):
        blocks = np.repeat(signature.lines.mean[None], count, axis=0)
        lines = replace(signature.lines, amplitude=blocks)
        variances.append(WheelPattern.of(wheel, lines).variance * lines.independent_blocks)
    np.testing.assert_allclose(variances[0], variances[1])


def test_what_stands_beside_is_no_part_of_a_gears_own_lines():
    signature = analysis().signature
    wheel = signature.plan.wheels[0]
    beside = np.stack([np.roll(wheel.lines, 1), np.roll(wheel.lines, -1)])
    plain = WheelPattern.of(wheel, signature.lines)
    found = WheelPattern.of(replace(wheel, beside=beside), signature.lines)
    for name in ("amplitude", "variance"):
        own = getattr(plain, name)
        np.testing.assert_array_equal(getattr(found, name), own)
        others = getattr(found, "beside" if name == "amplitude" else "beside_variance")
        np.testing.assert_array_equal(others, [np.roll(own, 1, 1), np.roll(own, -1, 1)])


def test_tooth_counts_in_words():
    assert tooth_counts(two_stages()) == "26/53, 23/61"
    assert tooth_counts(planetary()) == "20/40/100"


def test_nothing_is_no_reference():
    with pytest.raises(ArgumentError, match="at least one healthy recording"):
        make_reference([], machine())


def test_a_recording_without_mesh_is_no_reference():
    empty = Recording(samples=white((2, 40_000)), sampling_rate_hz=10_000.0, origin="empty.csv")
    signature = measure_signature(empty, machine())
    with pytest.raises(ArgumentError, match=r"empty\.csv: no mesh found"):
        make_reference([signature], machine())


def test_channels_must_agree():
    one = measure_signature(recording().select(["a1", "tacho"]), machine())
    with pytest.raises(ArgumentError, match=r"channels a1, a2 differ from a1 .*--channel"):
        make_reference([one, analysis().signature], machine())


def test_families_must_have_something_in_common():
    signature = analysis().signature
    plan = replace(signature.plan, families=())
    levels = {"level_db": np.zeros((2, 0)), "scatter_db": np.zeros((2, 0))}
    bare = replace(signature, plan=plan, digests=("another", "one"), **levels)
    with pytest.raises(ArgumentError, match="share no family of lines"):
        make_reference([signature, bare], machine())


@pytest.mark.parametrize("turned", [False, True])
def test_families_are_those_that_all_recordings_show(turned):
    signature = analysis().signature
    kept = signature.plan.families[2:]
    plan = replace(signature.plan, families=kept)
    levels = {name: getattr(signature, name)[:, 2:] for name in ("level_db", "scatter_db")}
    fewer = replace(signature, plan=plan, digests=("another", "one"), **levels)
    known = make_reference([fewer, signature] if turned else [signature, fewer], machine())
    assert known.family_names == tuple(own.name for own in kept)


def _array():
    file = io.BytesIO()
    np.save(file, np.arange(5.0))
    return file.getvalue()


def damaged(stored, kind):
    """Contents of a file that is no good reference."""
    whole = stored.read_bytes()
    middle = len(whole) // 2
    return {
        "empty": b"",
        "text": b"this is a letter\n",
        "csv": b"a1,a2\n0.1,0.2\n0.3,0.4\n",
        "first half": whole[:middle],
        "last half": whole[middle:],
        "a byte": whole[:1],
        "nearly whole": whole[:-10],
        "flipped": whole[:middle]
        + bytes(b ^ 0xFF for b in whole[middle : middle + 400])
        + whole[middle + 400 :],
        "zeros": bytes(5000),
        "pickle": b"\x80\x04\x95\x0b\x00\x00\x00\x00\x00\x00\x00\x8c\x07gearmon\x94.",
        "npy": b"\x93NUMPY\x01\x00",
        "array": _array(),
    }[kind]


@pytest.mark.parametrize(
    "kind",
    [
        "empty",
        "text",
        "csv",
        "first half",
        "last half",
        "a byte",
        "nearly whole",
        "flipped",
        "zeros",
        "pickle",
        "npy",
        "array",
    ],
)
def test_damaged_files_get_one_line(stored, tmp_path, kind):
    path = tmp_path / "bad.ref"
    path.write_bytes(damaged(stored, kind))
    with pytest.raises(SignatureError, match=r"bad\.ref: not a readable gearmon reference") as told:
        read_reference(path)
    assert "\n" not in str(told.value)


def test_missing_file_and_folder_get_one_line(tmp_path):
    with pytest.raises(SignatureError, match="no such file; make one with gearmon learn"):
        read_reference(tmp_path / "missing.ref")
    with pytest.raises(SignatureError, match="is a folder, no gearmon reference"):
        read_reference(tmp_path)
    assert not is_reference(tmp_path)
    assert not is_reference(tmp_path / "missing.ref")


def archive(path, **arrays):
    with path.open("wb") as file:
        np.savez(file, **arrays)


def header_of(form="gearmon reference 6", **changes):
    known = {
        "machine": "m",
        "teeth": "23/57",
        "channel_names": ["a1"],
        "units": [None],
        "family_names": [],
        "profiles": [],
        "version": "0.1.0",
        "machine_facts": {},
        "notes": [],
    }
    text = json.dumps({"format": form, "reference": known | changes})
    return np.frombuffer(text.encode(), dtype=np.uint8)


def test_what_changed_in_the_machine_file_is_told_as_it_was_and_as_it_is():
    known, own = reference(), machine()
    assert machine_notes(own, known) == []
    wider = replace(own, stages=(replace(own.stages[0], face_width_mm=44.0),))
    (told,) = machine_notes(wider, known)
    before = float(own.stages[0].face_width_mm)
    assert told.endswith(f": stage 1 face_width_mm {before}, now 44.0")
    unsaid = replace(own, stages=(replace(own.stages[0], face_width_mm=None),))
    (told,) = machine_notes(unsaid, known)
    assert told.endswith(f": stage 1 face_width_mm {before}, now none")
    named = replace(own, name="another box")
    (told,) = machine_notes(named, known)
    assert f"from {own.name!r}, the machine file names 'another box'" in told


def test_another_archive_gets_one_line(tmp_path):
    path = tmp_path / "other.npz"
    archive(path, values=np.arange(3))
    with pytest.raises(SignatureError, match="not a readable gearmon reference"):
        read_reference(path)


def test_a_zip_of_something_else_gets_one_line(tmp_path):
    path = tmp_path / "letters.zip"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("letter.txt", "dear reader")
    with pytest.raises(SignatureError, match="not a readable gearmon reference"):
        read_reference(path)


def test_a_pickled_object_is_never_loaded(tmp_path):
    path = tmp_path / "pickled.ref"
    archive(path, header=np.array([{"format": "gearmon reference 6"}], dtype=object))
    with pytest.raises(SignatureError, match="not a readable gearmon reference"):
        read_reference(path)


def test_another_format_says_which(tmp_path):
    path = tmp_path / "old.ref"
    archive(path, header=header_of("gearmon reference 4"))
    with pytest.raises(SignatureError, match=r"'gearmon reference 4' is not .*learn it anew"):
        read_reference(path)


@pytest.mark.parametrize(
    "changes", [{"profiles": [{}]}, {"profiles": 3}, {"profiles": []}, {"machine": 7}]
)
def test_header_with_wrong_profiles_gets_one_line(tmp_path, changes):
    path = tmp_path / "part.ref"
    archive(path, header=header_of(**changes))
    with pytest.raises(SignatureError, match="not a readable gearmon reference"):
        read_reference(path)


def test_writing_into_a_folder_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(ArgumentError, match="cannot write there"):
        write_reference(reference(), tmp_path / "nowhere" / "healthy.ref")
    assert list(tmp_path.iterdir()) == []


def rewritten(source, target, form, without="nothing"):
    """A copy of a stored reference that says it has another format."""
    with np.load(source) as archive:
        arrays = {name: archive[name] for name in archive.files if without not in name}
    header = json.loads(bytes(arrays["header"]))
    header["format"] = form
    arrays["header"] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
    with target.open("wb") as file:
        np.savez_compressed(file, **arrays)


def test_a_reference_of_an_unknown_format_is_refused(stored, tmp_path):
    newer = tmp_path / "newer.ref"
    rewritten(stored, newer, "gearmon reference 99")
    with pytest.raises(SignatureError, match="'gearmon reference 99' is not 'gearmon reference 6'"):
        read_reference(newer)


def test_a_reference_whose_foreign_lines_are_damaged_is_refused(stored, tmp_path):
    damaged = tmp_path / "damaged.ref"
    rewritten(stored, damaged, "gearmon reference 6", "hidden_db")
    with pytest.raises(SignatureError, match="not a readable gearmon reference"):
        read_reference(damaged)


@pytest.mark.parametrize("off", [0.89, 0.91, 1.09, 1.11])
def test_a_speed_is_covered_up_to_a_tenth_beside_what_was_learned(off):
    own = SimpleNamespace(speed=SimpleNamespace(estimated_hz=off * 25.0))
    told = other_speed(own, SimpleNamespace(profiles=[SimpleNamespace(speed_hz=25.0)]))
    assert (told is None) == (0.9 < off < 1.1)


def test_a_recording_is_held_against_the_channels_that_both_have():
    own = measure_signature(recording().select(["a2", "tacho"]), machine())
    known, rows = reference().shared_with(own)
    assert (known.channel_names, known.units, rows) == (("a2",), ("m/s2",), [0])
    assert reference().shared_with(own)[0] is known
    assert reference().shared_with(analysis().signature) == (reference(), [0, 1])
    for part, whole in zip(known.profiles, reference().profiles, strict=True):
        for name in ("level_db", "scatter_db", "heard", "band_db"):
            np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[1:])
        for one, both in zip(part.wheels, whole.wheels, strict=True):
            np.testing.assert_array_equal(one.amplitude, both.amplitude[1:])
            np.testing.assert_array_equal(one.variance, both.variance[1:])
        np.testing.assert_array_equal(part.foreign.in_time_db, whole.foreign.in_time_db[1:])
    others = replace(reference(), units=("m/s2", "g"))
    assert others.shared_with(own)[0].units == ("g",)
    turned = reference().profiles[0].part([1, 0])
    np.testing.assert_array_equal(turned.level_db, reference().profiles[0].level_db[::-1])


def test_channels_are_matched_by_name_in_whatever_order_they_were_recorded():
    names = ("a2", "tacho", "a1")
    known, rows = reference().shared_with(SimpleNamespace(channel_names=names))
    assert (known.channel_names, rows) == (("a2", "a1"), [0, 2])
    for part, whole in zip(known.profiles, reference().profiles, strict=True):
        np.testing.assert_array_equal(part.level_db, whole.level_db[::-1])


def test_planes_beside_the_turn_keep_their_channels():
    wheel = reference().profiles[0].wheels[0]
    beside = np.arange(2.0 * 2 * len(wheel.number)).reshape(2, 2, -1)
    planetary_wheel = replace(wheel, beside=beside + 0j, beside_variance=1.0 + beside)
    part = taken(planetary_wheel, [1])
    np.testing.assert_array_equal(part.beside, beside[:, 1:])
    np.testing.assert_array_equal(part.beside_variance, 1.0 + beside[:, 1:])


def test_families_are_told_in_the_order_asked_for():
    own = reference().profiles[0]
    names = own.family_names[2::-1]
    for told, whole in zip(
        own.of_families(names), (own.level_db, own.scatter_db, own.heard), strict=True
    ):
        np.testing.assert_array_equal(told, whole[:, [2, 1, 0]])


def altered(array):
    """An array as damage leaves it: with other axes, without a channel or line, with odd values."""
    yield array.ravel()[:, None]
    yield from (np.delete(array, 0, axis) for axis in range(array.ndim))
    for value in (np.nan, np.inf, 1e302) if array.dtype.kind in "fc" else ():
        own = array.copy()
        own.flat[:1] = np.array(value, dtype=complex).astype(array.dtype)
        yield own


# bands without a bin hold no number, and spectra may have any number of cells
SOUND = {"band_db": {3}, "noise_db": {2}, "hidden_db": {2}, "in_time_db": {2}}


def test_arrays_of_other_types_are_refused(stored, tmp_path):
    """Of other precision, of other numbers, or of none: every array of the first recording."""
    path = tmp_path / "bad.ref"
    with np.load(stored) as file:
        arrays = {name: file[name] for name in file.files}
    others = {"f8": "f4", "f4": "f8", "c16": "c8", "i8": "i4", "b1": "i1"}
    for name in [own for own in arrays if own.startswith("/profiles/0/")]:
        archive(path, **arrays | {name: arrays[name].astype(others[arrays[name].dtype.str[1:]])})
        with pytest.raises(SignatureError, match="not a readable gearmon reference"):
            read_reference(path)


@pytest.mark.filterwarnings("ignore")
def test_arrays_of_other_shapes_and_numbers_that_none_records_are_refused(stored, tmp_path):
    path = tmp_path / "bad.ref"
    with np.load(stored) as file:
        arrays = {name: file[name] for name in file.files}
    assert len(arrays) > 20
    for name in [own for own in arrays if own.startswith("/profiles/0/") and arrays[own].size]:
        for number, own in enumerate(altered(arrays[name])):
            if number in SOUND.get(name.rpartition("/")[2], ()):
                continue
            archive(path, **arrays | {name: own})
            with pytest.raises(SignatureError, match="not a readable gearmon reference"):
                read_reference(path)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -1.0, 0.0])
@pytest.mark.parametrize("name", ["speed_hz", "duration_s", "sampling_rate_hz", "cell_hz"])
def test_numbers_that_must_be_above_zero_are_refused_otherwise(stored, tmp_path, name, value):
    path = tmp_path / "bad.ref"
    with np.load(stored) as file:
        arrays = {own: file[own] for own in file.files}
    header = json.loads(bytes(arrays["header"]))
    profile = header["reference"]["profiles"][0]
    (profile["foreign"] if name == "cell_hz" else profile)[name] = value
    arrays["header"] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
    archive(path, **arrays)
    with pytest.raises(SignatureError, match="cannot be"):
        read_reference(path)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *[("level_db", 7e3), ("level_db", -7.1e3), ("scatter_db", -1e-3), ("band_db", 7e3)],
        *[("wheels/0/number", 0), ("wheels/0/number", 10**7), ("wheels/0/variance", -1e-300)],
        *[("foreign/grids/0/noise_db", 1e12), ("foreign/in_time_db", 1e12)],
    ],
)
def test_values_beyond_their_bounds_are_refused(stored, tmp_path, name, value):
    path = tmp_path / "bad.ref"
    with np.load(stored) as file:
        arrays = {own: file[own] for own in file.files}
    arrays[f"/profiles/0/{name}"].flat[-1] = value
    archive(path, **arrays)
    with pytest.raises(SignatureError, match=f"its {name.rpartition('/')[2]} cannot be"):
        read_reference(path)


@pytest.mark.parametrize("place", ["wheels", "foreign"])
def test_words_and_numbers_of_parts_are_checked(stored, tmp_path, place):
    path = tmp_path / "bad.ref"
    with np.load(stored) as file:
        arrays = {own: file[own] for own in file.files}
    changes = {
        "wheels": [{"stage": 0}, {"stage": 100}, {"teeth": 0}, {"order": 0.0}],
        "foreign": [{"kind": "cepstrum"}, {"width": 0.0}, {"top": -1.0}, {"pieces": 0}],
    }
    for change in changes[place]:
        header = json.loads(bytes(arrays["header"]))
        part = header["reference"]["profiles"][0][place]
        (part if place == "wheels" else part["grids"])[0] |= change
        told = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
        archive(path, **arrays | {"header": told})
        with pytest.raises(SignatureError, match="cannot be"):
            read_reference(path)


@pytest.mark.parametrize("share", [-0.1, -1e-4, 1e-4, 0.1])
def test_gears_that_turn_faster_or_slower_than_learned_are_refused(share):
    known = reference()
    first, *others = known.profiles
    moved = tuple(replace(own, order=own.order * (1 + share)) for own in first.wheels)
    assert moved
    other = replace(known, profiles=(replace(first, wheels=moved), *others))
    with pytest.raises(ArgumentError, match="learn one for this machine"):
        machine_notes(machine(), other)


def lacking(known):
    """References that no learning makes, by what a reader names of them."""
    first, *others = known.profiles

    def of_first(**changes):
        return replace(known, profiles=(replace(first, **changes), *others))

    wheel, *more = first.wheels
    one_beside = {"beside": wheel.amplitude[None], "beside_variance": wheel.variance[None]}
    empty = first.foreign.in_time_db[:, :0]
    yield "channels", replace(known, channel_names=2 * known.channel_names[:1])
    yield "recordings", replace(known, profiles=())
    yield "recordings", replace(known, family_names=())
    yield "gears", of_first(wheels=first.wheels[1:])
    yield "gears", replace(known, profiles=tuple(replace(p, wheels=()) for p in known.profiles))
    yield "families", of_first(family_names=("mesh 7", *first.family_names[1:]))
    yield "spectra", of_first(foreign=replace(first.foreign, grids=first.foreign.grids[::-1]))
    yield "spectra", of_first(foreign=replace(first.foreign, in_time_db=empty))
    yield "lines beside", of_first(wheels=(replace(wheel, **one_beside), *more))


def test_a_reference_whose_recordings_lack_a_part_is_refused_by_its_name(tmp_path):
    path = tmp_path / "bad.ref"
    for name, wrong in lacking(reference()):
        write_reference(wrong, path)
        with pytest.raises(SignatureError, match=f"its {name} cannot be"):
            read_reference(path)


@pytest.mark.parametrize("other", [{"stage": 2}, {"gear": "sun"}, {"teeth": 24}])
def test_the_same_gear_has_the_stage_the_name_and_the_teeth(other):
    own = reference().profiles[0].wheels[0]
    assert own.same_in([replace(own, **other), own]) is own
    assert own.same_in([replace(own, **other)]) is None


@pytest.mark.parametrize("channels", [2, 3, 5])
@pytest.mark.parametrize("louder_db", [0.0, 6.0, -20.0])
@pytest.mark.parametrize("better", [True, False])
def test_channels_are_exchanged_if_that_explains_more_than_gains_do(channels, louder_db, better):
    """As named each has a gain of its own beside what scatters; some channels stay in place."""
    bands, scatter = 40, 1.5
    rest = np.where(np.arange(bands) % 2, scatter, -scatter)
    change = np.full((channels + 1, channels + 1, bands), 40.0)
    gains = np.linspace(-12.0, 12.0, channels)
    for row in range(channels):
        change[row, row] = gains[row] + rest
        change[row, (row + 1) % channels] = (0.8 if better else 1.2) * rest
    change[channels, channels] = 0.1 * rest
    change += louder_db
    # bands that one channel lacks tell nothing of any
    change[0, :, [3, 8]] = np.nan
    names = [f"a{number}" for number in range(channels + 1)]
    if better:
        with pytest.raises(ArgumentError, match="a0 is like a1") as refused:
            _refuse_exchanged("new.csv", names, change)
        assert f"{names[-1]} is like" not in str(refused.value)
    else:
        _refuse_exchanged("new.csv", names, change)
