"""Whether a pair of gears can run: undercut, interference, pointed tips, contact ratio."""

from __future__ import annotations

import math
from dataclasses import replace

from gearmon.errors import ArgumentError
from gearmon.gears.involute import involute
from gearmon.gears.involute_pair import PairGeometry

#: Profile shifts are given with three decimals; less than this is rounding, not jamming.
SHIFT_ROUNDING = 0.01
#: Most that the tip of a ring is taken to be relieved without being told, in modules.
LARGEST_RING_TRIM = 0.3
#: Tip thickness below which tips are called sharp, in modules.
SHARP_TIP = 0.2
#: Profile shift that undercut teeth may lack, in modules, if their mate stays clear of it: the
#: practical limit of 14 teeth where 18 are needed in theory.
TOLERATED_UNDERCUT = 0.2


def check_pair(pair: PairGeometry) -> PairGeometry:
    """Return the pair with its warnings, or refuse it.

    Raises
    ------
    ArgumentError
        If the pair cannot run, with the number that offends and what would cure it.
    """
    warnings = [*pair.warnings, *_check_backlash(pair)]
    for index in (0, 1):
        warnings += _check_tip(pair, index)
    _check_contact_ratio(pair)
    for index in (0, 1):
        _check_clearance(pair, index)
    for index in (0, 1):
        if pair.sign(index) > 0:
            warnings += _check_root(pair, index)
    if pair.internal:
        warnings += _check_ring(pair)
    return replace(pair, warnings=tuple(warnings))


def trim_ring(pair: PairGeometry) -> PairGeometry:
    """Return an internal pair whose ring tips clear the involute of the mate, with a warning.

    Ring tips of full height reach below the involute of many planets; they are relieved in
    practice, and the path of contact then begins where the involute does.

    Raises
    ------
    ArgumentError
        If more than 0.3 modules would have to go.
    """
    if not pair.internal:
        return pair
    planet, ring = pair.gears
    base, offset = pair.base_radii_m[1], _line_length(pair)
    least = math.hypot(base, pair.form_rolls_m[0] + offset)
    trim = (least - pair.tip_radii_m[1]) / pair.normal_module_m
    if trim <= 1e-9:
        return pair
    if trim > LARGEST_RING_TRIM:
        raise ArgumentError(
            f"tip_factor_{ring.name}={ring.tip_factor:g}: the tips of the {ring.name} reach "
            f"{trim:.3g} modules below the involute of the {planet.name} (interference); give "
            f"tip_factor_{ring.name} <= {ring.tip_factor - trim:.3f}"
        )
    note = (
        f"the tips of the {ring.name} are taken as relieved by {trim:.3f} modules, for they would "
        f"touch the fillet of the {planet.name}; tip_factor_{ring.name} <= "
        f"{ring.tip_factor - trim:.3f} would say so"
    )
    return replace(
        pair,
        tip_radii_m=(pair.tip_radii_m[0], least),
        path_m=(pair.form_rolls_m[0], pair.path_m[1]),
        warnings=(*pair.warnings, note),
    )


def _line_length(pair: PairGeometry) -> float:
    """Distance between the base tangent points along the line of action."""
    return pair.centre_distance_m * math.sin(pair.working_pressure_angle_rad)


def _check_backlash(pair: PairGeometry) -> list[str]:
    first, second = pair.gears
    total = first.teeth + pair.sign(1) * second.teeth
    inv = involute(pair.working_pressure_angle_rad) - involute(pair.transverse_pressure_angle_rad)
    tight = inv * total / (2 * math.tan(pair.normal_pressure_angle_rad))
    given = first.profile_shift + second.profile_shift
    distance = 1e3 * pair.centre_distance_m
    if given > tight + SHIFT_ROUNDING:
        raise ArgumentError(
            f"centre_distance_mm={distance:.5g} jams the teeth: profile_shift_{first.name} + "
            f"profile_shift_{second.name} = {given:g}, but this distance takes {tight:.4f} at most"
        )
    if given < tight - 0.2:
        return [
            f"profile shifts sum to {given:g} where the centre distance {distance:.5g} mm has room "
            f"for {tight:.3f}: the pair has much backlash"
        ]
    return []


def _check_tip(pair: PairGeometry, index: int) -> list[str]:
    gear = pair.gears[index]
    if pair.tip_radii_m[index] < pair.base_radii_m[index]:
        raise ArgumentError(
            f"tip_factor_{gear.name}={gear.tip_factor:g} puts the tips of the {gear.name} at "
            f"{1e3 * pair.tip_radii_m[index]:.5g} mm, inside its base circle of "
            f"{1e3 * pair.base_radii_m[index]:.5g} mm, where there is no involute; "
            f"{'reduce' if pair.sign(index) < 0 else 'raise'} tip_factor_{gear.name}"
        )
    thickness = pair.tip_thicknesses_m[index] * math.cos(pair.helix_angle_rad)
    modules = thickness / pair.normal_module_m
    if modules <= 0:
        raise ArgumentError(
            f"the teeth of the {gear.name} are pointed: tip thickness {modules:.3f} modules with "
            f"profile_shift_{gear.name}={gear.profile_shift:g} and tip_factor_{gear.name}="
            f"{gear.tip_factor:g}; reduce either"
        )
    if modules < SHARP_TIP:
        return [f"the teeth of the {gear.name} are sharp: tip thickness {modules:.3f} modules"]
    return []


def _check_contact_ratio(pair: PairGeometry) -> None:
    transverse = pair.transverse_contact_ratio
    # a helical pair whose face width is not known cannot be judged by its total
    helical = pair.helix_angle_rad > 0
    if helical and pair.face_width_m is None:
        return
    ratio = pair.total_contact_ratio if helical else transverse
    if ratio >= 1 and transverse > 0:
        return
    first, second = pair.gears
    name = "total contact ratio" if helical else "contact ratio"
    raise ArgumentError(
        f"{name} {ratio:.4f} is below 1: no pair would carry for a while; reduce the "
        f"centre distance ({1e3 * pair.centre_distance_m:.5g} mm) or the profile shifts, or raise "
        f"tip_factor_{first.name} or tip_factor_{second.name}"
    )


def _check_clearance(pair: PairGeometry, index: int) -> None:
    mate = 1 - index
    if pair.internal:
        outer = pair.root_radii_m[1] - pair.centre_distance_m - pair.tip_radii_m[0]
        inner = pair.tip_radii_m[1] - pair.centre_distance_m - pair.root_radii_m[0]
        gap = outer if index == 0 else inner
    else:
        gap = pair.centre_distance_m - pair.tip_radii_m[index] - pair.root_radii_m[mate]
    if gap <= 0:
        gear, other = pair.gears[index].name, pair.gears[mate].name
        raise ArgumentError(
            f"the tips of the {gear} run {-1e3 * gap:.4g} mm into the roots of the {other}; "
            f"reduce tip_factor_{gear} or raise root_factor_{other} or the centre distance"
        )


def _check_root(pair: PairGeometry, index: int) -> list[str]:
    """Contact must stay on the involute of an external gear."""
    gear, mate = pair.gears[index], pair.gears[1 - index]
    start = pair.path_m[0] if index == 0 else _line_length(pair) - pair.path_m[1]
    form = pair.form_rolls_m[index]
    least = pair.rack(index).least_shift(gear.teeth)
    undercut = gear.profile_shift < least - 1e-9
    short = (form - start) / pair.normal_module_m
    if short > 1e-6:
        where = f"the tips of the {mate.name} reach {short:.3g} modules below the involute of"
        if undercut:
            raise ArgumentError(
                f"{where} the {gear.name}, whose {gear.teeth} teeth are undercut at "
                f"profile_shift_{gear.name}={gear.profile_shift:g}; give at least {least:.4f}, or "
                f"{pair.rack(index).least_teeth(gear.profile_shift)} teeth"
            )
        raise ArgumentError(
            f"{where} the {gear.name} (interference); reduce tip_factor_{mate.name}="
            f"{mate.tip_factor:g} or raise root_factor_{gear.name}={gear.root_factor:g}"
        )
    if not undercut:
        return []
    if gear.profile_shift < least - TOLERATED_UNDERCUT:
        raise ArgumentError(
            f"the {gear.teeth} teeth of the {gear.name} are undercut at "
            f"profile_shift_{gear.name}={gear.profile_shift:g}, beyond the practical limit of "
            f"{least - TOLERATED_UNDERCUT:.4f}; give at least {least:.4f}, or "
            f"{pair.rack(index).least_teeth(gear.profile_shift)} teeth"
        )
    return [
        f"the {gear.teeth} teeth of the {gear.name} are undercut below the path of contact: "
        f"profile_shift_{gear.name}={gear.profile_shift:g} where {least:.4f} would avoid it"
    ]


def _check_ring(pair: PairGeometry) -> list[str]:
    planet, ring = pair.gears
    end = math.hypot(pair.base_radii_m[1], pair.path_m[1] + _line_length(pair))
    if end > pair.root_radii_m[1]:
        raise ArgumentError(
            f"the tips of the {planet.name} touch the {ring.name} beyond its root circle "
            f"({1e3 * end:.5g} > {1e3 * pair.root_radii_m[1]:.5g} mm); reduce "
            f"tip_factor_{planet.name} or raise root_factor_{ring.name}"
        )
    room = _tip_passage(pair)
    if room < 0:
        raise ArgumentError(
            f"tips of {planet.name} and {ring.name} collide outside the mesh by "
            f"{-math.degrees(room):.3g} deg: ring_teeth - planet_teeth = "
            f"{ring.teeth - planet.teeth} is too small; "
            f"take more teeth in the ring or reduce the tip factors"
        )
    room = _radial_passage(pair)
    if room < 0:
        return [
            f"the {planet.name} cannot be put into the {ring.name} radially, only along its axis: "
            f"tips would collide by {-math.degrees(room):.3g} deg"
        ]
    return []


def _tip_passage(pair: PairGeometry) -> float:
    """Angle [rad] by which the tips of the inner gear miss those of the ring where they cross."""
    inner, outer = pair.tip_radii_m
    a = pair.centre_distance_m
    reach = (outer**2 - inner**2 - a**2) / (2 * a * inner)
    if reach >= 1:
        return math.inf
    at_inner = math.acos(reach)
    at_outer = math.acos((a**2 + outer**2 - inner**2) / (2 * a * outer))
    tips = [
        involute(math.acos(min(1.0, base / tip)))
        for base, tip in zip(pair.base_radii_m, pair.tip_radii_m, strict=True)
    ]
    working = involute(pair.working_pressure_angle_rad)
    teeth = pair.gears[0].teeth / pair.gears[1].teeth
    return (at_inner + tips[0] - working) * teeth + working - tips[1] - at_outer


def _radial_passage(pair: PairGeometry) -> float:
    """Angle [rad] by which the tips of the inner gear pass those of the ring moving radially.

    Where a tip of the one passes a tip of the other at the same distance from the line of
    centres, at the angle at which that is tightest.
    """
    tips = [
        math.acos(min(1.0, base / tip))
        for base, tip in zip(pair.base_radii_m, pair.tip_radii_m, strict=True)
    ]
    ratio = pair.gears[1].teeth / pair.gears[0].teeth
    inner, outer = pair.tip_radii_m
    # y of both tips is equal, and so is its rate as the gears roll: sin^2 of both angles follows
    radii = outer / inner
    if radii >= ratio:
        return math.inf
    square = (ratio**2 - radii**2) / (ratio**2 - 1)
    at_inner = math.asin(math.sqrt(min(1.0, square)))
    at_outer = math.asin(min(1.0, math.sin(at_inner) / radii))
    working = involute(pair.working_pressure_angle_rad)
    own = at_inner + involute(tips[0]) - working
    return own - ratio * (at_outer + involute(tips[1]) - working)
