"""A recording and a reference that do not belong together: every mismatch is refused or said."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from reference.small_gearbox import CRACK, HEALTHY_LOADS, machine, recording, reference
from reference.synthetic_signals import as_recording

from gearmon.diagnosis.analysis import analyse, learn
from gearmon.errors import ArgumentError, GearmonError
from gearmon.machine import OperatingPoint
from gearmon.signatures.measured.reference import read_reference, write_reference
from gearmon.simulation import simulate


def changed(known, **fields):
    stage = replace(known.stages[0], **fields)
    return replace(known, stages=(stage,))


def sampled(own, change, **fields):
    """The same recording with other samples."""
    samples = own.samples.copy()
    return replace(own, samples=change(samples), **fields)


def exchanged(samples):
    return samples[[1, 0, 2]]


def louder(samples):
    samples[0] *= 10.0
    return samples


def quieter(samples):
    samples[0] *= 0.1
    return samples


def integrated(samples):
    """Velocities in mm/s where the file does not tell."""
    velocity = np.fft.rfft(samples[:2])
    frequency = np.fft.rfftfreq(samples.shape[1], 1e-4)
    velocity[:, 1:] *= 1e3 / (2j * np.pi * frequency[1:])
    velocity[:, 0] = 0.0
    samples[:2] = np.fft.irfft(velocity, samples.shape[1])
    return samples


def every_other(samples):
    return samples[:, ::2]


def running_at(share):
    """A healthy recording of the machine at another speed."""
    point = OperatingPoint(speed_rpm=share * 2960.0, torque_nm=120.0)
    other = replace(machine(), operating=(point,))
    return as_recording(simulate(other, [], 4.0, 10_000.0, machine_seed=1, channels=2))


UNIT = ("mm/s", "mm/s", "V")
NO_UNIT = (None, None, "V")
NAMES = ("left", "right", "tacho")

MISMATCHES = {
    "unit": (lambda r: replace(r, units=UNIT), None, "mm/s, in .* it is in m/s2"),
    "unit of one only": (lambda r: replace(r, units=NO_UNIT), None, "the unit of a1, a2 is known"),
    "rate": (
        lambda r: sampled(r, every_other, sampling_rate_hz=5000.0),
        None,
        "sampled at 5000 Hz, .* at 10000 Hz",
    ),
    "machine": (None, lambda m: replace(m, name="pump 2"), "'small gearbox', .*'pump 2'"),
    "machine data": (
        None,
        lambda m: changed(m, face_width_mm=20.0),
        "face_width_mm 28.0, now 20.0",
    ),
    "channel order": (lambda r: sampled(r, exchanged), None, "look exchanged: a1 is like a2"),
    "gain 0.1": (
        lambda r: sampled(r, quieter),
        None,
        r"channel a1 is about (19|20) dB quieter .*\(factor (8\.[5-9]|9|9\.\d|10)\)",
    ),
    "gain 10": (
        lambda r: sampled(r, louder),
        None,
        r"channel a1 is about 2[01] dB louder .*\(factor 1[01]\)",
    ),
    "other sensor": (
        lambda r: sampled(r, integrated, units=NO_UNIT),
        None,
        "another kind of sensor",
    ),
    "other names": (lambda r: replace(r, channel_names=NAMES), None, "if they were renamed"),
    "other teeth": (None, lambda m: changed(m, gear_teeth=58), "learned for teeth 23/57"),
    "nominal speed": (
        None,
        lambda m: replace(m, operating=(OperatingPoint(speed_rpm=2900.0, torque_nm=120.0),)),
        "speed_rpm 2960.0, now 2900.0",
    ),
    "other speed": (
        lambda _: running_at(0.85),
        lambda m: replace(m, operating=(OperatingPoint(speed_rpm=2516.0, torque_nm=120.0),)),
        r"turns at 4\d.* Hz, in the reference at 4\d.*: add healthy recordings at this speed",
    ),
    "own file": (lambda _: recording(load=0.85, seed=1), None, "this recording is the same as"),
}


@pytest.mark.parametrize("mismatch", MISMATCHES)
def test_every_mismatch_is_said_in_words_and_none_is_a_fault(mismatch):
    of_recording, of_machine, words = MISMATCHES[mismatch]
    own, known = recording(), machine()
    own = of_recording(own) if of_recording else own
    known = of_machine(known) if of_machine else known
    try:
        answer = analyse(own, known, reference())
    except GearmonError as refused:
        told = str(refused)
    else:
        assert answer.verdict != "fault"
        told = " / ".join((answer.reason, *answer.warnings))
    assert "\n" not in told
    assert re.search(words, told)


def test_what_fits_is_not_remarked_upon():
    for fault in ("", CRACK):
        told = analyse(recording(fault), machine(), reference()).warnings
        assert told == ("tacho tacho: 1 pulse a turn",)


@pytest.mark.parametrize("version", ["0.0.1", ""])
def test_a_reference_of_another_version_says_so(version):
    answer = analyse(recording(), machine(), replace(reference(), version=version))
    assert any("learn it anew" in note for note in answer.warnings)


def test_a_reference_remembers_through_its_file(tmp_path):
    write_reference(replace(reference(), notes=("doubtful",)), tmp_path / "a.ref")
    stored = read_reference(tmp_path / "a.ref")
    assert stored.machine_facts == reference().machine_facts
    assert (stored.version, stored.notes) == (reference().version, ("doubtful",))
    for old, new in zip(reference().profiles, stored.profiles, strict=True):
        assert (new.digests, new.sampling_rate_hz) == (old.digests, 10_000.0)
    answer = analyse(recording(load=0.85, seed=1), machine(), stored)
    assert "reference: doubtful" in answer.warnings
    assert any("from which the reference was learned" in note for note in answer.warnings)


# Learning


def healthy():
    return [recording(load=load, seed=seed) for seed, load in enumerate(HEALTHY_LOADS)]


def test_sound_recordings_raise_no_doubts():
    assert reference().notes == ()


@pytest.mark.parametrize("copied", [(0, 1), (0,), (1,)])
def test_the_same_recording_counts_once(copied):
    """Even if one of its channels is another one."""
    samples = recording(load=0.85, seed=1).samples.copy()
    samples[list(copied)] = recording(load=0.7, seed=0).samples[list(copied)]
    again = replace(recording(load=0.85, seed=1), samples=samples, origin="copy.csv")
    again = replace(again, channel_names=("a1", "a2", "t"))
    with pytest.raises(ArgumentError, match=r"copy\.csv: holds the same samples as @0\.7"):
        learn([recording(load=0.7, seed=0), again], machine())


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda r: replace(r, units=UNIT), "is in mm/s, in .* it is in m/s2"),
        (lambda r: sampled(r, every_other, sampling_rate_hz=5000.0), "was sampled at 5000 Hz"),
        (lambda r: replace(r, channel_names=NAMES), "channels left, right differ from a1, a2"),
    ],
)
def test_recordings_that_do_not_belong_together_are_not_learned(change, words):
    with pytest.raises(ArgumentError, match=words):
        learn([recording(load=0.7, seed=0), change(recording(load=0.85, seed=1))], machine())


def test_a_recording_that_departs_from_the_others_is_named():
    notes = learn([*healthy()[:2], recording(CRACK, load=1.0)], machine()).notes
    assert any(note.startswith(f"{CRACK}@1.0: departs from the other") for note in notes)
