"""Which picture stands for which figure of the study, with our captions."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Picture:
    """One picture.

    Attributes
    ----------
    name : str
        Of its file and of the function that draws it.
    figures : tuple of int
        Figures of the study that it stands for; empty where the study has none.
    title, caption : str
    """

    name: str
    figures: tuple[int, ...]
    title: str
    caption: str


PICTURES: tuple[Picture, ...] = (
    Picture(
        name="stiffness_forms",
        figures=(1,),
        title="Four forms of mesh stiffness",
        caption="Mesh stiffness over two mesh periods, all with the mean 0.8 GN/m and a step of "
        "26 % of it between the levels of the rectangle. The Fourier sum has the harmonics 1 to 41 "
        "of the rectangle at the true duty 0.412; dashed, the square wave of half duty with its "
        "odd harmonics alone, which the sweeps use as the study does.",
    ),
    Picture(
        name="stiffness_form_spectra",
        figures=(2, 3),
        title="Spectra of the four forms",
        caption="Exact Fourier amplitudes, no FFT of samples. The first line is nearly the same. "
        "The three forms that jump run together again at high orders, where only the jump counts. "
        "The sums end at the 41st harmonic. At half duty the even lines vanish.",
    ),
    Picture(
        name="form_responses",
        figures=(4, 5, 6),
        title="From rest under three forms",
        caption="Displacement, velocity and acceleration of the reference case, integrated from "
        "rest (broad) and solved by multiple scales (thin). The axes of velocity and "
        "acceleration are scaled to the settled vibration; the start leaves them.",
    ),
    Picture(
        name="mesh_force",
        figures=(7,),
        title="Mesh force",
        caption="Total mesh force k(t) z + c z'. It steps up when a second pair enters contact "
        "(phase 0) and down when one is left (phase 0.412, or 0.5 at half duty), then returns to "
        "the transmitted force within a fraction of the mesh period.",
    ),
    Picture(
        name="orders",
        figures=(),
        title="Orders of the expansion (equations 9 to 26)",
        caption="Steady displacement to orders 0, 1 and 2, its error against the exact solution, "
        "the error of higher orders, and the power of eps with which each error falls.",
    ),
    Picture(
        name="stiffness_from_rest",
        figures=(8, 9, 10),
        title="Stiffness sweep from rest",
        caption="Eight stiffnesses, the other parameters at their reference. The start has axes of "
        "its own because it dwarfs the settled vibration in velocity and acceleration.",
    ),
    Picture(
        name="stiffness_settled",
        figures=(11, 12, 13, 14),
        title="Stiffness sweep, one settled mesh period",
        caption="Two pairs carry in the first half of the period, one in the second. The "
        "displacement scales with F/k; the acceleration has the same peaks at every stiffness and "
        "rings faster.",
    ),
    Picture(
        name="stiffness_spectra",
        figures=(15, 16, 18),
        title="Stiffness sweep, spectra together",
        caption="Amplitudes of the odd harmonics, joined to guide the eye; the even ones, of "
        "second order in eps, are in the separate views. Displacement as level: linear, all but "
        "the first lines would vanish.",
    ),
    Picture(
        name="stiffness_velocity_lines",
        figures=(17,),
        title="Stiffness sweep, velocity lines one by one",
        caption="All harmonics. The even ones are the answer of second order.",
    ),
    Picture(
        name="stiffness_acceleration_lines",
        figures=(19,),
        title="Stiffness sweep, acceleration lines one by one",
        caption="The largest line follows the natural frequency (dotted) and keeps its height.",
    ),
    Picture(
        name="mass_in_time",
        figures=(20, 21),
        title="Mass sweep, displacement",
        caption="Nine masses. A heavier pair rings longer and slower; none comes near zero once "
        "the start is over.",
    ),
    Picture(
        name="mass_separate",
        figures=(22,),
        title="Mass sweep, displacement one by one",
        caption="From rest. The displacement swings about F/k0 (grey) and stays positive at every "
        "mass, 3 kg included.",
    ),
    Picture(
        name="mass_spectra",
        figures=(23,),
        title="Mass sweep, acceleration spectra together",
        caption="Odd harmonics, joined to guide the eye. The band narrows as the mass grows; 2 kg "
        "stands out because harmonic 5 lies on its natural frequency.",
    ),
    Picture(
        name="mass_lines",
        figures=(24,),
        title="Mass sweep, acceleration lines one by one",
        caption="All harmonics; the natural frequency is dotted.",
    ),
    Picture(
        name="damping_in_time",
        figures=(25, 26),
        title="Damping sweep, displacement",
        caption="Nine dampings. From 30 kN s/m on there is no overshoot: the damping is above "
        "critical.",
    ),
    Picture(
        name="damping_separate",
        figures=(27,),
        title="Damping sweep, displacement one by one",
        caption="From rest; grey: F/k0.",
    ),
    Picture(
        name="damping_spectra",
        figures=(28,),
        title="Damping sweep, acceleration spectra together",
        caption="Odd harmonics, joined to guide the eye. Damping lowers the lines around the "
        "natural frequency and hardly those below.",
    ),
    Picture(
        name="damping_lines",
        figures=(29,),
        title="Damping sweep, acceleration lines one by one",
        caption="All harmonics; the natural frequency is dotted.",
    ),
    Picture(
        name="energy_of_stiffness",
        figures=(30, 31),
        title="Energy lines of the stiffness sweep",
        caption="E = (2 pi f A)²/2 per kilogram, A the displacement amplitude of a line. Above: "
        "odd harmonics, joined to guide the eye. Below: all of them, one value a panel.",
    ),
    Picture(
        name="energy_of_mass",
        figures=(32, 33),
        title="Energy lines of the mass sweep",
        caption="Per kilogram, so that the total hardly changes up to 1 kg; times the mass it "
        "grows.",
    ),
    Picture(
        name="energy_of_damping",
        figures=(34, 35),
        title="Energy lines of the damping sweep",
        caption="The total falls as 1/c while the damping is below critical, and the strongest "
        "line moves down to the mesh frequency.",
    ),
    Picture(
        name="energy_of_reference",
        figures=(36,),
        title="Energy lines of the reference case",
        caption="Above: several lines within a third of the best. Below: what a generator of 5 g "
        "with a mechanical damping ratio of 0.01 would give if the housing moved as the pair does, "
        "which is an upper end.",
    ),
    Picture(
        name="contact",
        figures=(),
        title="Where the teeth would part",
        caption="Least mesh force of the settled vibration over F; the teeth part where it is zero "
        "or less, and the linear model ends there. Without a steady vibration (unstable) it is "
        "drawn at the lower edge. All parameters not named are at their reference.",
    ),
    Picture(
        name="damage",
        figures=(),
        title="What a damaged tooth adds",
        caption="The same equation over a turn of the pinion, with one tooth weaker over its "
        "contact.",
    ),
    Picture(
        name="speed",
        figures=(),
        title="Substitution against simulation",
        caption="Time to the settled vibration of a new set of parameters, measured in this run on "
        "this machine. A simulation starts from rest and drops the first mesh period.",
    ),
)

LAST_FIGURE = 36


def figure_index() -> dict[int, Picture]:
    """Return the picture that stands for each figure of the study.

    Examples
    --------
    >>> sorted(figure_index()) == list(range(1, LAST_FIGURE + 1))
    True
    """
    found = {number: picture for picture in PICTURES for number in picture.figures}
    return dict(sorted(found.items()))
