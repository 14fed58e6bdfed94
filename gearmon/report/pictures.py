"""Which pictures a report has, with the words that go with each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gearmon.diagnosis.results import Analysis, ToothProfile
from gearmon.report import captions
from gearmon.report.level_views import change_views, level_views, pattern_views
from gearmon.report.plots import PAGE_WIDTH_IN, as_png, left_label, legend, new_figure, style
from gearmon.report.plots_levels import (
    label_groups,
    plot_changes,
    plot_levels,
    plot_pattern,
    sideways_labels,
)
from gearmon.report.plots_spectrum import label_meshes, label_sidebands, plot_spectrum
from gearmon.report.plots_turn import label_teeth, plot_speed, plot_teeth, plot_turn
from gearmon.report.spectrum_views import close_up_views, spectrum_views
from gearmon.report.turn_views import profile_of, speed_view, teeth_view, turn_views
from gearmon.report.views import SpectrumView
from gearmon.signals.recording import Recording
from gearmon.signatures.families import WheelLines
from gearmon.signatures.measured import MeshFinding
from gearmon.signatures.reference import Reference

# More channels than this get no readable strip each: the report says which are shown.
MOST_STRIPS = 8


@dataclass(frozen=True, kw_only=True, eq=False)
class Picture:
    """A picture with its words.

    Parameters
    ----------
    name : str
        Part of the file name, as "spectrum".
    title : str
        Heading.
    caption : str
        What to look for.
    alt : str
        What is to be seen, for readers who do not see it.
    png : bytes
        The picture.
    """

    name: str
    title: str
    caption: str
    alt: str
    png: bytes


def pictures(
    analysis: Analysis, recording: Recording | None, reference: Reference | None
) -> list[Picture]:
    """Draw all pictures that an analysis bears.

    Parameters
    ----------
    analysis : Analysis
        The analysis.
    recording : Recording or None
        Its recording; without, the spectra are left out.
    reference : Reference or None
        What it was compared with.

    Returns
    -------
    list of Picture
        In the order of the report.
    """
    with style():
        return list(_pictures(analysis, recording, reference))


def _pictures(
    analysis: Analysis, recording: Recording | None, reference: Reference | None
) -> Iterator[Picture]:
    if recording is not None:
        yield _spectrum(analysis, recording)
        for mesh in analysis.signature.meshes:
            picture = _close_up(analysis, recording, mesh, mesh.stage == 1)
            if picture:
                yield picture
    if not analysis.signature.found:
        return
    if analysis.changes:
        yield _changes(analysis)
    yield _levels(analysis, reference)
    if any(len(view.harmonics) for view in pattern_views(analysis)):
        yield _pattern(analysis)
    wheels = [wheel for wheel in analysis.signature.plan.wheels if len(wheel.number)]
    for row, wheel in enumerate(wheels):
        yield _turn(analysis, wheel, row == 0)
    yield _speed(analysis)


def _spectrum(analysis: Analysis, recording: Recording) -> Picture:
    views, remark = spectrum_views(analysis, recording)
    figure = _strips(views[:MOST_STRIPS])
    return Picture(
        name="spectrum",
        title="Amplitude spectrum",
        caption=f"{captions.spectrum(analysis)} {remark}{_left_out(len(views))}",
        alt=captions.spectrum_alt(views),
        png=as_png(figure),
    )


def _close_up(
    analysis: Analysis, recording: Recording, mesh: MeshFinding, first: bool
) -> Picture | None:
    views, harmonic = close_up_views(analysis, recording, mesh)
    if not len(views[0].frequency_hz):
        return None
    figure = _strips(views[:MOST_STRIPS])
    found = analysis.signature.found
    return Picture(
        name=f"sidebands-mesh-{mesh.stage}" if found else f"searched-mesh-{mesh.stage}",
        title=f"Around mesh {mesh.stage}, harmonic {harmonic}",
        caption=captions.close_up(analysis, mesh, first) + _left_out(len(views)),
        alt=captions.close_up_alt(analysis, mesh, harmonic),
        png=as_png(figure),
    )


def _strips(views: Sequence[SpectrumView]) -> Figure:
    """One spectrum above the other, with a common frequency axis."""
    heights = [_strip_height(len(views))] * len(views)
    # room above for the names of the lines, sideways, or for a legend
    figure, axes = new_figure(heights, top_in=0.45 if views[0].legend else 0.68, sharex=True)
    for view, ax in zip(views, axes, strict=True):
        plot_spectrum(view, ax)
    if len({view.unit for view in views}) == 1:
        _common_scale(axes)
    if views[0].legend:
        label_sidebands(views[0], axes[0])
        legend(figure, axes)
    else:
        label_meshes(views[0], axes[0])
    axes[-1].set_xlabel(views[0].axis)
    left_label(figure, axes, "Peak amplitude")
    return figure


def _strip_height(count: int) -> float:
    # two pictures of four channels, with their words, fit on a page
    return 0.74 if count > 3 else 1.2


def _common_scale(axes: Sequence[Axes]) -> None:
    """One scale for all channels of one unit shows which is loud and which is not."""
    limits = [ax.get_ylim() for ax in axes]
    for ax in axes:
        ax.set_ylim(min(low for low, _ in limits), max(high for _, high in limits))


def _left_out(channels: int) -> str:
    if channels <= MOST_STRIPS:
        return ""
    return f" The first {MOST_STRIPS} of {channels} channels are shown."


def _levels(analysis: Analysis, reference: Reference | None) -> Picture:
    views = level_views(analysis, reference)
    shown = views[:MOST_STRIPS]
    bottom = 0.85 if sideways_labels(shown[0].groups) else 0.5
    figure, axes = new_figure(
        [_strip_height(len(shown))] * len(shown), top_in=0.62, bottom_in=bottom, sharex=True
    )
    for view, ax in zip(shown, axes, strict=True):
        plot_levels(view, ax)
    label_groups(shown[0].groups, axes[0], axes[-1])
    legend(figure, axes, columns=2)
    left_label(figure, axes, "Level (dB re 1 unit², peak amplitudes)")
    return Picture(
        name="levels",
        title="Levels against the healthy recordings" if reference else "Levels of the lines",
        caption=captions.levels(reference) + _left_out(len(views)),
        alt=captions.levels_alt(analysis),
        png=as_png(figure),
    )


def _changes(analysis: Analysis) -> Picture:
    views = change_views(analysis)
    heights = [0.24 * len(view.rows) for view in views]
    figure, axes = new_figure(heights, left_in=1.25, right_in=0.75, gap_in=0.62)
    for view, ax in zip(views, axes, strict=True):
        image = plot_changes(view, ax)
    scale = figure.add_axes((1 - 0.65 / PAGE_WIDTH_IN, 0.25, 0.11 / PAGE_WIDTH_IN, 0.5))
    bar = figure.colorbar(image, cax=scale, extend="both")
    bar.set_label("Change (dB)")
    return Picture(
        name="changes",
        title="Changes against the reference",
        caption=captions.changes(),
        alt=captions.changes_alt(analysis),
        png=as_png(figure, many_colours=True),
    )


def _pattern(analysis: Analysis) -> Picture:
    views = pattern_views(analysis)
    figure, axes = new_figure([1.45] * len(views), bottom_in=0.52, gap_in=0.45)
    for view, ax in zip(views, axes, strict=True):
        plot_pattern(view, ax)
    legend(figure, axes, columns=5)
    axes[-1].set_xlabel("Harmonic of the mesh frequency")
    return Picture(
        name="pattern",
        title="Mesh harmonics against the expected signature",
        caption=captions.pattern(),
        alt=captions.pattern_alt(views),
        png=as_png(figure),
    )


def _counted_from(profile: ToothProfile) -> str | None:
    return None if profile.tooth is None else profile.counted_from or "tacho"


def _turn(analysis: Analysis, wheel: WheelLines, first: bool) -> Picture:
    views = turn_views(analysis, wheel)
    profile = profile_of(analysis, wheel)
    heights = [0.56 if len(views) > 2 else 0.8] * len(views) + [0.85] * (profile is not None)
    figure, axes = new_figure(heights, sharex=True)
    for view, ax in zip(views, axes, strict=False):
        plot_turn(view, ax)
    if profile is not None:
        plot_teeth(teeth_view(analysis, profile), axes[-1])
    label_teeth(wheel.teeth, None if profile is None else _counted_from(profile), axes[-1])
    legend(figure, axes[:1])
    return Picture(
        name=f"turn-{wheel.stage}-{wheel.gear}",
        title=f"One turn of the {wheel.gear} of stage {wheel.stage} ({wheel.teeth} teeth)",
        caption=captions.turn(analysis, wheel, profile, first),
        alt=captions.turn_alt(analysis, wheel, profile),
        png=as_png(figure),
    )


def _speed(analysis: Analysis) -> Picture:
    figure, axes = new_figure([1.4], right_in=0.65)
    plot_speed(speed_view(analysis), axes[0])
    legend(figure, axes)
    return Picture(
        name="speed",
        title="Speed over time",
        caption=captions.speed(analysis),
        alt=captions.speed_alt(analysis),
        png=as_png(figure),
    )
