"""From an analysis to what pictures show of a gear's turn and of the speed."""

from __future__ import annotations

import numpy as np

from gearmon.diagnosis.results import Analysis, ToothProfile
from gearmon.report.curves import extremes, turn_waveforms
from gearmon.report.views import FloatArray, SpeedView, TeethView, TurnView
from gearmon.report.wording import unit_text
from gearmon.signatures.families import WheelLines

# More channels than this make the pictures of a turn unreadable: the strongest are taken.
MOST_CHANNELS = 4
# Pictures number teeth at the middle of their contact. Tooth j is in contact from j - 1 to about
# j + 0.6 mesh periods after the angle zero; profiles hold the energy at whole mesh periods.
_CONTACT_CENTRE = 0.8


def turn_views(analysis: Analysis, wheel: WheelLines) -> list[TurnView]:
    """Return the synchronous average of one gear in the channels where its lines are strongest.

    Parameters
    ----------
    analysis : Analysis
        The analysis.
    wheel : WheelLines
        The gear.

    Returns
    -------
    list of TurnView
        At most `MOST_CHANNELS`, in the order of the channels.
    """
    signature = analysis.signature
    average, rest = turn_waveforms(signature.lines, wheel)
    power = np.mean(average**2, axis=1)
    strongest = sorted(np.argsort(-power, kind="stable")[:MOST_CHANNELS].tolist())
    flagged = flagged_place(analysis, wheel.stage, wheel.gear)
    profile = profile_of(analysis, wheel)
    offset = 0.0 if profile is None else count_offset(profile)
    views = []
    for channel in strongest:
        tooth, drawn = _by_tooth(average[channel], wheel.teeth, offset)
        _, drawn_rest = _by_tooth(rest[channel], wheel.teeth, offset)
        views.append(
            TurnView(
                channel=signature.channel_names[channel],
                unit=unit_text(signature.units[channel]),
                teeth=wheel.teeth,
                tooth=tooth,
                average=drawn,
                rest=drawn_rest,
                flagged=flagged,
            )
        )
    return views


def _by_tooth(waveform: FloatArray, teeth: int, offset: float) -> tuple[FloatArray, FloatArray]:
    """One turn against the tooth number, from half a tooth before tooth 1: bars and curve agree."""
    points = len(waveform)
    place = _wrapped(tooth_number(teeth * np.arange(points) / points) + offset, teeth)
    order = np.argsort(place, kind="stable")
    return place[order], waveform[order]


def profile_of(analysis: Analysis, wheel: WheelLines) -> ToothProfile | None:
    """Return the tooth profile of a gear, None if there is none."""
    for profile in analysis.profiles:
        if (profile.stage, profile.gear) == (wheel.stage, wheel.gear):
            return profile
    return None


def flagged_place(analysis: Analysis, stage: int, gear: str) -> float | None:
    """Return the place of a flagged tooth as a tooth number, None if no tooth is flagged.

    Between two numbers where the energy peaks between two teeth.
    """
    for flag in analysis.flags:
        if flag.kind == "tooth damage" and (flag.stage, flag.gear) == (stage, gear):
            for profile in analysis.profiles:
                if (profile.stage, profile.gear) == (stage, gear):
                    return peak_place(profile)
            return None if flag.tooth is None else float(flag.tooth)
    return None


def peak_place(profile: ToothProfile) -> float:
    """Return where in the turn the energy of a profile is highest, as a tooth number."""
    place = tooth_number(np.array([profile.position * profile.teeth])) + count_offset(profile)
    return float(_wrapped(place, profile.teeth)[0])


def count_offset(profile: ToothProfile) -> float:
    """Return what turns numbers from the recording's angle zero into those of the evidence.

    Teeth counted from the reference begin elsewhere than this recording does: the tooth that stands
    out has both a place in the recording and its number, and the difference holds for all.
    """
    if profile.tooth is None or profile.counted_from != "reference":
        return 0.0
    place = tooth_number(np.array([profile.position * profile.teeth]))
    return profile.tooth - float(place[0])


def tooth_number(mesh_periods: FloatArray) -> FloatArray:
    """Return mesh periods after the angle zero as tooth numbers: j in the middle of its contact."""
    return np.asarray(mesh_periods + 1.0 - _CONTACT_CENTRE, dtype=float)


def _wrapped(number: FloatArray, teeth: int) -> FloatArray:
    """Tooth numbers brought to one turn, from half a tooth before tooth 1."""
    return (number - 0.5) % teeth + 0.5


def teeth_view(analysis: Analysis, profile: ToothProfile) -> TeethView:
    """Return what a picture shows of a tooth profile."""
    return TeethView(
        energy=profile.energy,
        number=_wrapped(
            tooth_number(np.arange(float(profile.teeth))) + count_offset(profile), profile.teeth
        ),
        place=peak_place(profile),
        ratio=profile.ratio,
        flagged=flagged_place(analysis, profile.stage, profile.gear) is not None,
        numbered=profile.tooth is not None,
        against=profile.against,
    )


def speed_view(analysis: Analysis) -> SpeedView:
    """Return the speed over time, thinned to what a picture can show."""
    track, speed = analysis.signature.track, analysis.signature.speed
    middle = 0.5 * (track.time_s[:-1] + track.time_s[1:])
    time_s, speed_hz = extremes(middle, track.speed_hz)
    if len(time_s) == 1:
        time_s, speed_hz = track.time_s, np.repeat(speed_hz, 2)
    return SpeedView(
        time_s=time_s,
        speed_hz=speed_hz,
        mean_hz=speed.estimated_hz,
        uncertainty_hz=speed.uncertainty_hz,
        nominal_hz=speed.nominal_hz,
        method=speed.method,
    )
