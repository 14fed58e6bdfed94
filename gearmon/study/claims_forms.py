"""Claims on the stiffness and on the responses to its four forms."""

from __future__ import annotations

import numpy as np

from gearmon.gears.stiffness_forms import zone_means
from gearmon.study.findings import CLOSED_FORM, STUDY, Claim, Evidence, Finding, verdict_of
from gearmon.study.reference_case import (
    BASE_DIAMETERS_MM,
    CONTACT_RATIO,
    REFERENCE,
)
from gearmon.study.responses import dynamic_difference
from gearmon.study.results import StudyResults

#: |c_1| ... |c_5| over the mean of the parabolic form, from its closed-form Fourier series.
PARABOLA_HARMONICS = (0.1373112, 0.0505471, 0.0287304, 0.0342730, 0.0033705)
#: Gibbs: peak of the sum of a +-1 square wave less one, over the jump of 2.
GIBBS_OVERSHOOT = 0.0894899


def parabola(results: StudyResults) -> Finding:
    """Check ends, zone means and harmonics of the parabolic form, and its sum over the pairs."""
    signal = results.forms["parabolic"].signal
    pair = signal.pulse.value(CONTACT_RATIO * np.array([0.0, 0.5]))
    high, low = zone_means(CONTACT_RATIO)
    found = np.abs(signal.pulse.transform(np.arange(1, 6))) / signal.mean
    exact = 1e-6
    evidence = (
        Evidence(
            quantity="stiffness of a pair at the ends of contact over that in the middle",
            ours=float(pair[0] / pair[1]),
            expected=0.55,
            source=STUDY,
            tolerance=exact,
        ),
        Evidence(
            quantity="mean stiffness over the greatest of a pair",
            ours=signal.mean,
            expected=1.2002,
            source=CLOSED_FORM,
            tolerance=exact,
        ),
        Evidence(
            quantity="mean of the two-pair zone over the greatest of a pair",
            ours=high,
            expected=1.523046,
            source=CLOSED_FORM,
            tolerance=exact,
        ),
        Evidence(
            quantity="mean of the one-pair zone over the greatest of a pair",
            ours=low,
            expected=0.973988,
            source=CLOSED_FORM,
            tolerance=exact,
        ),
        *(
            Evidence(
                quantity=f"harmonic {n} of the stiffness over its mean",
                ours=float(ours),
                expected=expected,
                source=CLOSED_FORM,
                tolerance=2e-5,
            )
            for n, (ours, expected) in enumerate(
                zip(found, PARABOLA_HARMONICS, strict=True), start=1
            )
        ),
    )
    return Finding(
        verdict=verdict_of(all(item.agrees for item in evidence)),
        reason=f"A parabola per pair, added over the pairs, gives {high:.4f} of the greatest "
        f"stiffness of a pair while two carry and {low:.4f} while one does. It is a model: that "
        "pairs share no compliance of the rims is assumed, not shown.",
        evidence=evidence,
    )


def gear_data(results: StudyResults) -> Finding:
    """Whether the printed gear data agree among themselves."""
    gears = results.gears
    evidence = (
        Evidence(
            quantity="base diameter of the pinion (printed as pitch diameter)",
            ours=gears.base_diameters_mm[0],
            unit="mm",
            expected=BASE_DIAMETERS_MM[0],
            source=STUDY,
            tolerance=1e-5,
        ),
        Evidence(
            quantity="base diameter of the gear (printed as pitch diameter)",
            ours=gears.base_diameters_mm[1],
            unit="mm",
            expected=BASE_DIAMETERS_MM[1],
            source=STUDY,
            tolerance=1e-5,
        ),
        Evidence(
            quantity="contact ratio (printed as face width ratio)",
            ours=gears.contact_ratio,
            expected=CONTACT_RATIO,
            source=STUDY,
            tolerance=3e-4,
        ),
        Evidence(
            quantity="force from the torque",
            ours=gears.force_n,
            unit="N",
            expected=REFERENCE.force_n,
            source=STUDY,
        ),
        Evidence(
            quantity="mesh frequency of the printed period (the speed gives 632.7 Hz)",
            ours=1 / REFERENCE.period_s,
            unit="Hz",
            expected=gears.mesh_frequency_hz,
            source=STUDY,
        ),
    )
    rounded = 1 / REFERENCE.period_s / gears.mesh_frequency_hz - 1
    return Finding(
        verdict=verdict_of(*(item.agrees for item in evidence)),
        reason="Read under the right labels the gear data agree. The simulated period of "
        f"{1e3 * REFERENCE.period_s:g} ms is rounded: its lines lie {100 * rounded:+.1f} % from "
        "those of the printed speed.",
        evidence=evidence,
    )


def form_spectra(results: StudyResults) -> Finding:
    """Whether the four forms share their first line and part in the higher ones."""
    keys = ("parabolic", "wave", "rectangular", "fourier")
    shapes = {key: np.abs(results.forms[key].signal.shape_harmonics(60)) for key in keys}
    table = np.array([shapes[key] for key in keys])
    first = float(table[:, 0].max() / table[:, 0].min())
    high = np.sqrt((table[:, 9:40] ** 2).sum(axis=1))
    jumpers = float(high[:3].max() / high[:3].min())
    beyond = np.sqrt((table[:, 41:] ** 2).sum(axis=1))
    half = abs(results.forms["fourier-half"].signal.shape_harmonics(2))
    evidence = (
        Evidence(quantity="first harmonic: largest over smallest of the forms", ours=first),
        Evidence(
            quantity="harmonics 10 to 40 (RSS): largest over smallest of the forms that jump",
            ours=jumpers,
        ),
        Evidence(
            quantity="harmonics above 41 of the Fourier sum over those of the rectangle",
            ours=float(beyond[3] / beyond[2]),
            expected=0.0,
            source=CLOSED_FORM,
            tolerance=1e-9,
        ),
        Evidence(
            quantity="second harmonic over the first: rectangle of the true duty 0.412",
            ours=float(table[2, 1] / table[2, 0]),
        ),
        Evidence(
            quantity="second harmonic over the first: square wave of half duty",
            ours=float(half[1] / half[0]),
            expected=0.0,
            source=STUDY,
            tolerance=1e-9,
        ),
    )
    same_first, part_higher = first < 1.1, bool(beyond[3] < 1e-9 * beyond[2])
    return Finding(
        verdict=verdict_of(same_first, part_higher, float(table[2, 1]) < 1e-3 * table[2, 0]),
        reason=f"The first harmonic is the same within {100 * (first - 1):.0f} % and the forms "
        "part above it. But only odd cosines remain at half duty alone: at the duty of this "
        f"contact ratio the second harmonic is {100 * table[2, 1] / table[2, 0]:.0f} % of the "
        "first.",
        evidence=evidence,
    )


def closest_form(results: StudyResults) -> Finding:
    """Which form's response is closest to that under the parabolic reference."""
    truth = results.forms["parabolic"]
    found = {
        key: dynamic_difference(results.forms[key], truth)
        for key in ("wave", "rectangular", "fourier")
    }
    evidence = tuple(
        Evidence(
            quantity=f"{results.forms[key].signal.label}: difference of the dynamic displacement "
            "to that under the parabola",
            ours=100 * value,
            unit="%",
        )
        for key, value in found.items()
    )
    holds = found["rectangular"] < found["wave"], found["fourier"] < found["wave"]
    return Finding(
        verdict=verdict_of(*holds),
        reason="Taking the parabola for the meshing gears, the wave form is off by "
        f"{100 * found['wave']:.2g} %, the rectangle by {100 * found['rectangular']:.2g} % and its "
        f"Fourier sum by {100 * found['fourier']:.2g} %. The study's definition of the wave form "
        "is lost; ours has half-sine arches through the parabola's end and middle values.",
        evidence=evidence,
    )


def settling(results: StudyResults) -> Finding:
    """Whether the wave form settles later than the others."""
    found = {
        key: results.forms[key].longest_settling_s for key in ("wave", "rectangular", "fourier")
    }
    evidence = tuple(
        Evidence(
            quantity=f"{results.forms[key].signal.label}: time until F/k(t) is followed within 5 % "
            "of its step",
            ours=1e3 * value,
            unit="ms",
        )
        for key, value in found.items()
    )
    others = max(found["rectangular"], found["fourier"])
    return Finding(
        verdict=verdict_of(found["wave"] > 1.05 * others),
        reason=f"After a change of pairs the vibration settles in {1e3 * found['wave']:.2f} ms "
        f"under the wave form and in {1e3 * others:.2f} ms under the others: the decay rate c/(2 "
        f"m) = {REFERENCE.decay_rate:.0f} 1/s is that of mass and damping, not of the form.",
        evidence=evidence,
    )


def gibbs(results: StudyResults) -> Finding:
    """Overshoot of the Fourier sum, and what of it reaches the displacement."""
    square = results.forms["fourier-half"].signal
    fine = np.arange(20_000) / 20_000
    overshoot = float(square.shape(fine).max() - 1) / 2
    ripple = dynamic_difference(results.forms["fourier"], results.forms["rectangular"])
    peaks = {
        key: float(np.abs(response.simulated.acceleration_ms2[response.last_period]).max())
        for key, response in results.forms.items()
    }
    evidence = (
        Evidence(
            quantity="overshoot of the sum over the jump",
            ours=100 * overshoot,
            unit="%",
            expected=100 * GIBBS_OVERSHOOT,
            source=CLOSED_FORM,
            tolerance=5e-3,
        ),
        Evidence(
            quantity="displacement: Fourier sum against rectangle", ours=100 * ripple, unit="%"
        ),
        Evidence(
            quantity="peak acceleration: Fourier sum over rectangle",
            ours=peaks["fourier"] / peaks["rectangular"],
        ),
    )
    return Finding(
        verdict=verdict_of(evidence[0].agrees),
        reason=f"The sum overshoots by {100 * overshoot:.2f} % of the jump. Of that only "
        f"{100 * ripple:.1f} % shows in the displacement, but the peak of the acceleration falls "
        f"to {100 * peaks['fourier'] / peaks['rectangular']:.0f} % of that under the rectangle.",
        evidence=evidence,
    )


def mesh_force(results: StudyResults) -> Finding:
    """How the mesh force jumps, settles and repeats."""
    response = results.forms["rectangular"]
    force = response.simulated.mesh_force_n
    last = force[response.last_period]
    before = force[-2 * len(last) - 1 : -len(last) - 1]
    cut = round((CONTACT_RATIO - 1) * len(last))
    entering, leaving = float(last[0] - last[-1]), float(last[cut] - last[cut - 1])
    zones = float(last[:cut].mean()), float(last[cut:].mean())
    one_pair = float(last[cut] - last[cut - 1] / 2)
    repeat = float(np.abs(last - before).max() / REFERENCE.force_n)
    evidence = (
        Evidence(
            quantity="mean mesh force",
            ours=float(last.mean()),
            unit="N",
            expected=REFERENCE.force_n,
            source="balance of momentum",
            tolerance=1e-3,
        ),
        Evidence(quantity="jump as a second pair enters contact", ours=entering, unit="N"),
        Evidence(quantity="jump as one pair is left", ours=leaving, unit="N"),
        Evidence(
            quantity="jump of the force of one pair as the other is left (two share evenly)",
            ours=one_pair,
            unit="N",
        ),
        Evidence(quantity="mean while two pairs carry", ours=zones[0], unit="N"),
        Evidence(quantity="mean while one pair carries", ours=zones[1], unit="N"),
        Evidence(
            quantity="change from one mesh period to the next, over F",
            ours=repeat,
            expected=0.0,
            source="periodic vibration",
            tolerance=1e-4,
        ),
    )
    return Finding(
        verdict=verdict_of(evidence[0].agrees, evidence[-1].agrees, leaving > 0 > entering),
        reason="It jumps, settles and repeats with the mesh period, but the total force changes by "
        f"{entering:+.0f} N as a second pair enters and by {leaving:+.0f} N as one is left, "
        "because z cannot jump while k does, and its mean is F in both zones within "
        f"{100 * max(abs(z / REFERENCE.force_n - 1) for z in zones):.2f} %. Read as the force of "
        f"one pair, which changes by {one_pair:+.0f} N when it is left alone, the claim holds.",
        evidence=evidence,
    )


FORM_CLAIMS = (
    Claim(
        key="1a",
        text="The stiffness of one tooth pair is a parabola over its contact; pairs add like "
        "parallel springs.",
        where="eq. 1, Fig. 1",
        evaluate=parabola,
    ),
    Claim(
        key="1b",
        text="The gear data and the model parameters describe one pair.",
        where="Tables 1 and 2",
        evaluate=gear_data,
    ),
    Claim(
        key="2",
        text="The spectra of the four forms differ mainly in their harmonics; of the rectangle "
        "only odd cosines remain.",
        where="Fig. 1-3",
        evaluate=form_spectra,
    ),
    Claim(
        key="3a",
        text="Rectangle and Fourier sum move the pair more like meshing gears than the wave form.",
        where="Fig. 4-6",
        evaluate=closest_form,
    ),
    Claim(
        key="3b",
        text="The wave form has longer transients after a change of pairs.",
        where="Fig. 4-6",
        evaluate=settling,
    ),
    Claim(
        key="3c",
        text="The Fourier sum adds the ripple of Gibbs.",
        where="Fig. 1, 6",
        evaluate=gibbs,
    ),
    Claim(
        key="4",
        text="The mesh force jumps up as one pair takes the whole load, settles by damping and "
        "repeats with the mesh period.",
        where="Fig. 7",
        evaluate=mesh_force,
    ),
)
