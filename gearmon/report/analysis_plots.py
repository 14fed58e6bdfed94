"""The pictures of an analysis in the order of a report; here the turn of a gear and the speed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from gearmon.diagnosis.results import Analysis, ToothProfile
from gearmon.report.curves import extremes, turn_waveform
from gearmon.report.level_plots import changes_figure
from gearmon.report.palette import BLACK, BLUE, DASHED, GREY, LIGHT_GREY, SKY, VERMILLION
from gearmon.report.plots import Picture, legend, light_grid, new_figure, style
from gearmon.report.spectrum_plots import amplitude_figure, close_up_figure
from gearmon.report.wording import percent, probability_text, strip_label, unit_text
from gearmon.signals.recording import Recording
from gearmon.signals.transforms import fast_length
from gearmon.signatures.measured.line_plan import WheelLines
from gearmon.signatures.measured.reference import WheelPattern

FloatArray = NDArray[np.float64]

# More channels than this make the picture of a turn unreadable: the strongest are taken.
_MOST_CHANNELS = 4
_MOST_TOOTH_LABELS = 34
# Pictures number teeth at the middle of their contact. Tooth j is in contact from j - 1 to about
# j + 0.6 mesh periods after the angle zero; profiles hold the energy at whole mesh periods.
_CONTACT_CENTRE = 0.8
_COUNTED = {
    "tacho": "Tooth (tooth 1 at the tachometer pulse)",
    "reference": "Tooth (tooth 1 where the first healthy recording begins)",
    None: "Tooth, from the start of the recording (relative: no tachometer on this shaft)",
}


def analysis_figures(analysis: Analysis, recording: Recording | None = None) -> Iterator[Picture]:
    """Draw all pictures that an analysis bears, one at a time, in the order of a report.

    Parameters
    ----------
    analysis : Analysis
        The analysis.
    recording : Recording or None
        Its recording; without, the spectra are left out.

    Yields
    ------
    Picture
        With its words.
    """
    signature = analysis.signature
    if recording is not None:
        yield amplitude_figure(analysis, recording)
        for mesh in signature.meshes:
            close_up = close_up_figure(analysis, recording, mesh)
            if close_up is not None:
                yield close_up
    if not signature.found:
        return
    if analysis.changes:
        yield changes_figure(analysis)
    wheels = [wheel for wheel in signature.plan.wheels if len(wheel.number)]
    for row, wheel in enumerate(wheels):
        yield turn_figure(analysis, wheel, at_length=row == 0)
    yield speed_figure(analysis)


def analysis_pictures(analysis: Analysis, recording: Recording | None = None) -> dict[str, Picture]:
    """Return the pictures of `analysis_figures` by their names."""
    return {own.name: own for own in analysis_figures(analysis, recording)}


@style()
def turn_figure(analysis: Analysis, wheel: WheelLines, *, at_length: bool = True) -> Picture:
    """Draw one turn of a gear: its synchronous average by channel, and its energy by tooth.

    Parameters
    ----------
    analysis : Analysis
        The analysis.
    wheel : WheelLines
        The gear, of the plan of its signature.
    at_length : bool
        Whether the caption explains everything, as that of the first gear does.

    Returns
    -------
    Picture
    """
    signature = analysis.signature
    pattern = WheelPattern.of(wheel, signature.lines)
    # eight points a cycle of the highest line draw its crests within a tenth
    points = fast_length(8 * (int(wheel.number.max()) + 1))
    average, rest = (turn_waveform(pattern, points, mesh=mesh) for mesh in (True, False))
    power = np.mean(average**2, axis=1)
    channels = sorted(np.argsort(-power, kind="stable")[:_MOST_CHANNELS].tolist())
    profile = profile_of(analysis, wheel.stage, wheel.gear)
    flagged = flagged_place(analysis, wheel.stage, wheel.gear)
    heights = [0.56 if len(channels) > 2 else 0.8] * len(channels)
    figure, axes = new_figure([*heights, *([0.85] if profile else [])], sharex=True)
    number = tooth_numbers(wheel.teeth * np.arange(points) / points, profile, wheel.teeth)
    order = np.argsort(number, kind="stable")
    for channel, ax in zip(channels, axes, strict=False):
        _mark_flagged(flagged, ax)
        _plot_turn(number[order], average[channel, order], rest[channel, order], ax)
        unit = unit_text(signature.units[channel])
        ax.set_ylabel(strip_label(signature.channel_names[channel], unit), fontsize=7)
    if profile is not None:
        _mark_flagged(flagged, axes[-1])
        _plot_teeth(profile, flagged is not None, axes[-1])
    counted_from = None
    if profile is not None and profile.tooth is not None:
        counted_from = profile.counted_from or "tacho"
    _label_teeth(wheel.teeth, _COUNTED.get(counted_from, _COUNTED[None]), axes[-1])
    legend(figure, axes[:1])
    alt = f"Synchronous average over one turn of the {wheel.gear} of stage {wheel.stage}"
    if profile is not None:
        alt += (
            f" and energy by tooth: highest at place {round(peak_place(profile))} of "
            f"{wheel.teeth}, {profile.ratio:.1f} times the median, "
            f"{'not ' if flagged is None else ''}flagged"
        )
    return figure.told(
        name=f"turn-{wheel.stage}-{wheel.gear}",
        heading=f"One turn of the {wheel.gear} of stage {wheel.stage} ({wheel.teeth} teeth)",
        caption=_turn_caption(analysis, profile, flagged is not None, at_length),
        alt=f"{alt}.",
    )


def _turn_caption(
    analysis: Analysis, profile: ToothProfile | None, flagged: bool, at_length: bool
) -> str:
    said = []
    if at_length:
        said.append(
            "Grey: synchronous average, what repeats with every turn of this gear. Blue: the same "
            "without the mesh harmonics, on the same scale. A damaged tooth shows as a short burst "
            "at one place of the blue curve in every channel; a slow wave over the turn is "
            "eccentricity."
        )
    if at_length and len(analysis.signature.channel_names) > _MOST_CHANNELS:
        said.append(f"The {_MOST_CHANNELS} strongest channels are shown.")
    if profile is None:
        said.append("The recording resolves too few lines of this gear for an energy by tooth.")
        return " ".join(said)
    if at_length:
        against = (
            "the departure from the healthy reference"
            if profile.against == "reference"
            else "what sets each tooth apart from the others of this gear (no reference)"
        )
        said.append(f"Bars: energy of {against}, all channels, over two teeth, elsewhere 1.")
    said.append(
        f"The highest of the {profile.teeth} is {profile.ratio:.1f} times that elsewhere; a "
        "healthy gear shows as much somewhere in its turn with probability "
        f"{probability_text(10.0**profile.log10_probability)}{': flagged' if flagged else ''}."
    )
    if at_length and profile.tooth is None:
        said.append(
            "Without a tachometer pulse on this shaft the tooth numbers count from where the "
            "recording happens to start: the pattern is real, the number is not that of the gear."
        )
    return " ".join(said)


def _plot_turn(number: FloatArray, average: FloatArray, rest: FloatArray, ax: Axes) -> None:
    ax.plot(number, average, color="#a9adb4", linewidth=0.6, label="synchronous average")
    ax.plot(number, rest, color=BLUE, linewidth=0.8, label="the same without mesh harmonics")
    light_grid(ax)
    ax.margins(x=0)
    ax.yaxis.set_major_locator(MaxNLocator(4))


def _plot_teeth(profile: ToothProfile, flagged: bool, ax: Axes) -> None:
    """Draw the energy of the deviation by tooth as bars; name the flagged tooth, or the highest."""
    teeth, top = profile.teeth, float(profile.energy.max())
    number = tooth_numbers(np.arange(float(teeth)), profile, teeth)
    peak = int(np.argmax(profile.energy))
    place, ratio = number[peak], top
    colours = [SKY] * teeth
    if flagged:  # found by its form, which may be clearest beside the highest bar
        place, ratio = peak_place(profile), profile.ratio
        peak = int(np.argmin(np.abs(number - place)))
        colours[peak] = VERMILLION
    ax.bar(number, profile.energy, width=0.8, color=colours, edgecolor=BLACK, linewidth=0.3)
    ax.axhline(1.0, color=BLACK, linewidth=0.7, linestyle=DASHED)
    name = "" if profile.tooth is None else f"tooth {(round(place) - 1) % teeth + 1}: "
    left = place > 0.6 * teeth
    state = "flagged" if flagged else "highest, not flagged"
    ax.annotate(
        f"{name}{ratio:.1f} × elsewhere ({state})",
        # above the bars beside it, which may be higher
        xy=(number[peak], top),
        xytext=(-6 if left else 6, 2),
        textcoords="offset points",
        ha="right" if left else "left",
        va="bottom",
        fontsize=7,
        fontweight="bold" if flagged else "normal",
    )
    ax.set_ylim(0, 1.25 * max(top, 1.6))
    light_grid(ax)
    ax.set_ylabel("Energy by tooth\n(elsewhere 1)", fontsize=7)


def _label_teeth(teeth: int, text: str, ax: Axes) -> None:
    step = 1 if teeth <= _MOST_TOOTH_LABELS else 5 if teeth <= 5 * _MOST_TOOTH_LABELS else 20
    ax.set_xlim(0.5, teeth + 0.5)
    ax.set_xticks([*range(1, teeth + 1)] if step == 1 else [1, *range(step, teeth + 1, step)])
    ax.set_xlabel(text)


def _mark_flagged(place: float | None, ax: Axes) -> None:
    if place is not None:
        ax.axvspan(place - 1.0, place + 1.0, color=VERMILLION, alpha=0.15, linewidth=0)


def profile_of(analysis: Analysis, stage: int, gear: str) -> ToothProfile | None:
    """Return the tooth profile of a gear, None if there is none."""
    own = (p for p in analysis.profiles if (p.stage, p.gear) == (stage, gear))
    return next(own, None)


def flagged_place(analysis: Analysis, stage: int, gear: str) -> float | None:
    """Return the place of a flagged tooth as a tooth number, None if no tooth is flagged.

    Between two numbers where the energy peaks between two teeth.
    """
    for flag in analysis.flags:
        if flag.kind == "tooth damage" and (flag.stage, flag.gear) == (stage, gear):
            profile = profile_of(analysis, stage, gear)
            if profile is not None:
                return peak_place(profile)
            return None if flag.tooth is None else float(flag.tooth)
    return None


def peak_place(profile: ToothProfile) -> float:
    """Return where in the turn the energy of a profile is highest, as a tooth number."""
    place = np.array([profile.position * profile.teeth])
    return float(tooth_numbers(place, profile, profile.teeth)[0])


def tooth_numbers(place: FloatArray, profile: ToothProfile | None, teeth: int) -> FloatArray:
    """Return tooth numbers of places in a turn, from half a tooth before tooth 1.

    Number j is in the middle of the contact of tooth j. Teeth counted from the reference begin
    elsewhere than the recording does: the tooth that stands out has both a place in the recording
    and its number, and the difference holds for all.

    Parameters
    ----------
    place : ndarray of float
        Tooth pitches from the angle zero of the recording.
    profile : ToothProfile or None
        Of the gear.
    teeth : int
        Teeth of the gear.
    """
    first = 1.0 - _CONTACT_CENTRE
    if profile is not None and profile.tooth is not None and profile.counted_from == "reference":
        first = profile.tooth - profile.position * teeth
    return np.asarray((place + first - 0.5) % teeth + 0.5, dtype=float)


def _rpm(speed_hz: Any) -> Any:
    return 60.0 * speed_hz


def _hz(speed_rpm: Any) -> Any:
    return speed_rpm / 60.0


@style()
def speed_figure(analysis: Analysis) -> Picture:
    """Draw the speed of shaft 1 over time.

    Parameters
    ----------
    analysis : Analysis
        The analysis.

    Returns
    -------
    Picture
    """
    track, speed = analysis.signature.track, analysis.signature.speed
    time_s, speed_hz = extremes(0.5 * (track.time_s[:-1] + track.time_s[1:]), track.speed_hz)
    if len(time_s) == 1:
        time_s, speed_hz = track.time_s, np.repeat(speed_hz, 2)
    figure, (ax,) = new_figure([1.4], right_in=0.65)
    nominal, mean = speed.nominal_hz, speed.estimated_hz
    ax.axhline(
        nominal, color=GREY, linewidth=0.9, linestyle=DASHED, label=f"nominal {nominal:.5g} Hz"
    )
    ax.axhline(mean, color=BLACK, linewidth=0.7, label=f"mean {mean:.6g} Hz")
    if np.isfinite(speed.uncertainty_hz):
        low, high = mean - speed.uncertainty_hz, mean + speed.uncertainty_hz
        ax.axhspan(low, high, color=LIGHT_GREY, linewidth=0)
    ax.plot(time_s, speed_hz, color=BLUE, linewidth=1.0, label=f"speed, by {speed.method}")
    lowest, highest = float(speed_hz.min()), float(speed_hz.max())
    # a steady speed must not be blown up until its last digit looks like trouble
    room = max(0.15 * (highest - lowest), 0.002 * mean)
    ax.set_ylim(min(lowest, nominal) - room, max(highest, nominal) + room)
    ax.set(xlim=(float(time_s[0]), float(time_s[-1])), xlabel="Time (s)", ylabel="Shaft 1 (Hz)")
    ax.ticklabel_format(useOffset=False)
    right = ax.secondary_yaxis("right", functions=(_rpm, _hz))
    right.set_ylabel("Shaft 1 (rpm)")
    light_grid(ax)
    legend(figure, [ax])
    how = (
        "from the tachometer pulses"
        if speed.method == "tacho"
        else "from the mesh and shaft lines of all stages together"
    )
    wander = percent((speed.highest_hz - speed.lowest_hz) / mean)
    return figure.told(
        name="speed",
        heading="Speed over time",
        caption=f"Speed of shaft 1 {how}: {percent(mean / nominal - 1, signed=True)} from nominal, "
        f"wandering over {wander} within the recording. Steps or spikes here mean that the speed "
        "was lost, and that all else in this report should be taken with care; a smooth wander is "
        "harmless.",
        alt=f"Speed of shaft 1 between {speed.lowest_hz:.5g} and {speed.highest_hz:.5g} Hz, mean "
        f"{mean:.6g} Hz, nominal {nominal:.5g} Hz.",
    )
