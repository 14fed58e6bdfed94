"""Which harvester may be tuned, and the tuning that yields most over a whole duty cycle.

The full response, all modes and loads, is looked at over the whole range of natural frequencies;
the best places are refined in frequency and load together (COBYLA of `scipy.optimize`, which keeps
limits). Limits of travel and stress are held to the peaks of the recordings themselves: the search
guesses them from the spectrum, the recordings correct how high a guess may be, and the best tuning
is refined on the recordings themselves.

The file of a harvester (TOML):

    kind = "cantilever"           # or "inertial", "coil"
    wiring = "series"             # "unimorph", "series" or "parallel"
    piezo = "PZT-5A"              # PZT-5A, PZT-5H, PVDF, AlN
    passive = "brass"             # steel, brass, aluminium
    length_mm = 15.0
    width_mm = 10.0
    passive_thickness_mm = 0.2
    piezo_thickness_mm = 0.2
    most_tip_mass_g = 20.0
    tip_gyration_mm = 5.0         # of the tip mass about the end of the beam; 0 for a point
    tip_block_height_mm = 4.0     # instead: a block as wide as the beam, longer the heavier it is
    tip_block_material = "steel"
    damping_ratio = 0.01
    air = "included"              # in the damping ratio, or "added" to it
    clearance_mm = 2.0
    restitution = 0.5             # speed behind a blow at the stop over that before: a guess
    tilt_deg = 0.0                # of the motion against the plumb line: 90 for a level motion
    load_ohm = 1e5                # only if the load is given: else it is tuned

    [budget]                      # all optional, see `SensorBudget`
    duration_s = 10.0

An inertial one has mass_g, damping_ratio, clearance_mm, restitution, tilt_deg, lowest_hz,
highest_hz and, as its load, electrical_damping_ratio; one with a coil has load_ohm instead, and
turns, field_length_tm (B l of a turn), coil_ohm and coil_mh.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import combinations_with_replacement
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy

from gearmon.errors import ArgumentError, check_range
from gearmon.harvesting import cantilever, response
from gearmon.harvesting.harvester import (
    FREQUENCY,
    CoilHarvester,
    H,
    Harvester,
    InertialHarvester,
    Real,
    half_power_band,
)
from gearmon.harvesting.response import Tuned, evaluate, mean_power_w, powers_and_shares
from gearmon.harvesting.vibration import Points, Shaking, check_duty, vibration_of_lines
from gearmon.machine.fields import Choice, FieldError, Number, read_source

#: A harvester at one natural frequency, loads, their power at every operating point, and their
#: largest peak over its limit.
Row = tuple[Any, Real, Real, Real]

#: Step of the first look, in damping ratios, and the most natural frequencies looked at; loads.
STEP, MOST_SCANNED, LOADS = 0.7, 4000, 22
#: Loud lines that are looked at as well, where the steps would have to be larger.
LOUDEST = 40
#: Bins are merged over these shares of a damping ratio, for the first look and for the search.
ROUGH_BINS, FINE_BINS = 0.5, 0.2
#: Places that are refined; one whose first look, this many times, is below the best is not.
PLACES, PRUNED_FROM = 6, 1.3
#: First and last step of the search, in damping ratios and logarithms of the load, and its length.
FIRST_STEP, LAST_STEP, MOST_STEPS = 0.3, 2e-3, 200
#: Corrections of the peaks by the recordings, and the peak over limit that they aim at.
CORRECTIONS, AIMED = 6, 0.995
#: Mixtures of the operating points whose best tunings the sets are made of.
MIXTURES = 100


class OverLimitsError(ArgumentError):
    """No tuning keeps within the limits of travel and stress.

    Attributes
    ----------
    over : float, > 1
        Peak over limit of the nearest: with that much less vibration it would hold.
    """

    def __init__(self, message: str, over: float) -> None:
        super().__init__(message)
        self.over = over


def tune_harvester(harvester: H, duty: Shaking, *, limited: bool = True) -> Tuned[H]:
    """Tune natural frequency and load for the largest mean power over a duty cycle.

    Parameters
    ----------
    harvester : InertialHarvester, CoilHarvester or PiezoCantilever
        What is to be tuned; of its natural frequency only the allowed range matters.
    duty : Vibration, Signature, OperatingShare or sequence of OperatingShare
        What shakes it: one vibration, the lines of a signature, or several with their shares of
        the time.
    limited : bool
        Whether limits of travel and stress are kept.

    Returns
    -------
    Tuned
        The tuned harvester with its load, mean power [W], and its peaks over their limits.

    Raises
    ------
    ArgumentError
        If nothing vibrates within reach, or no tuning keeps travel and stress within their limits;
        the message names the nearest that does.

    Examples
    --------
    >>> from gearmon.harvesting import InertialHarvester, vibration_of_lines
    >>> shaking = vibration_of_lines([120.0, 312.0], acceleration_ms2=[0.2, 0.8])
    >>> found = tune_harvester(InertialHarvester(mass_kg=5e-3, natural_frequency_hz=100.0), shaking)
    >>> round(found.harvester.natural_frequency_hz), round(1e6 * found.power_w)
    (312, 10)
    """
    return _tuned(harvester, check_duty(duty), limited)[0]


def _tuned(harvester: H, points: Points, limited: bool) -> tuple[Tuned[H], float]:
    """Tune, and tell how high a guessed peak over its limit may be."""
    best, places = _best(_rows(harvester, points, limited=False), points, math.inf)
    tuned = replace(evaluate(best, points), rivals_hz=places)
    if tuned.within_limits or not limited:
        return tuned, 1.0
    rows, fine = _rows(harvester, points), _lightened(harvester, points, FINE_BINS)
    tried, most = [(tuned, 1.0)], 1.0
    for _ in range(CORRECTIONS):
        best, _ = _best(rows, points, most)
        tuned = replace(evaluate(best, points), rivals_hz=places)
        tried.append((tuned, most))
        guessed = float(powers_and_shares(best, fine, np.array([best.load]))[1][0])
        measured = any(answer.quantiles for answer in tuned.answers)
        wanted = guessed / tuned.over * (AIMED if measured else 1.0)
        if abs(wanted / most - 1) < 1 - AIMED:
            break
        most = wanted
    allowed = [one for one in tried if one[0].within_limits]
    if not allowed:
        nearest, _ = min(tried, key=lambda one: one[0].over)
        raise OverLimitsError(_refusal(nearest), nearest.over)
    tuned, most = max(allowed, key=lambda one: one[0].power_w)
    if measured:  # how far a guess is off differs from tuning to tuning: the recordings decide
        with suppress(ArgumentError):  # too short for the ring-down of another
            shares = np.array([[point.share for point in points]])
            (best,), _ = _polished([tuned.harvester], points, shares, 1.0)
            tuned = replace(evaluate(best, points), rivals_hz=places)
    return tuned, most


def tuned_among(harvester: H, points: Points, places_hz: Sequence[float]) -> H:
    """Return the harvester tuned near one of a few natural frequencies, whatever its limits."""
    rows = _rows(harvester, points, places_hz, limited=False)
    return _best(rows, points, math.inf)[0]  # type: ignore[no-any-return]


def _rows(
    harvester: Harvester, points: Points, places: Any = None, *, limited: bool = True
) -> list[Row]:
    """Look at natural frequencies, all there are if none are given, each with many loads."""
    light, rows = _lightened(harvester, points, ROUGH_BINS), []
    wanted = _grid(harvester, light) if places is None else places
    for frequency in np.clip(wanted, *harvester.frequency_range_hz):
        tuned = harvester.retuned(float(frequency))
        loads = np.geomspace(*tuned.load_range, LOADS)
        rows.append((tuned, loads, *powers_and_shares(tuned, light, loads, limited=limited)))
    return rows


def _best(rows: Sequence[Row], points: Points, most: float) -> tuple[Any, tuple[float, ...]]:
    """Refine the best places of a first look; return the best, and where they are."""
    shares = np.array([point.share for point in points])
    worths = np.array([np.where(over <= most, shares @ p, -over) for _, _, p, over in rows])
    heights, loads = worths.max(axis=1), worths.argmax(axis=1)
    edged = np.pad(heights, 1, constant_values=-math.inf)
    few = len(rows) <= PLACES
    tops = np.flatnonzero((heights >= np.maximum(edged[:-2], edged[2:])) | few)
    tops = tops[np.argsort(-heights[tops], kind="stable")][:PLACES]
    starts = [rows[i][0].with_load(rows[i][1][loads[i]]) for i in tops.tolist()]
    light = _lightened(starts[0], points, FINE_BINS)
    best, reached = starts[0], -math.inf
    for start, height in zip(starts, heights[tops], strict=True):
        if PRUNED_FROM * height < reached:
            break
        (found,), power_w = _polished([start], light, shares[None], most)
        if power_w > reached:
            best, reached = found, power_w
    return best, tuple(start.natural_frequency_hz for start in starts)


def _polished(
    members: Sequence[H], light: Points, shares: Real, most: float
) -> tuple[list[H], float]:
    """Move frequencies and loads together to where their power is largest.

    That is the mean over the operating points, or of several harvesters that of the worst one.
    Returned with it; below 0 by the largest peak over its limit where that cannot be kept.
    """
    worst = len(shares) > 1
    known: dict[tuple[float, ...], tuple[Real, float]] = {}

    def moved(x: Sequence[float]) -> list[H]:
        steps = np.reshape(x, (-1, 2))
        return [_moved(own, *step) for own, step in zip(members, steps, strict=True)]

    def told(x: Real) -> tuple[Real, float]:
        """Power of what counts, and the largest peak over its limit."""
        steps = tuple(x[: 2 * len(members)].tolist())
        if steps not in known:
            how: dict[str, Any] = {"limited": math.isfinite(most)}
            looks = [powers_and_shares(m, light, np.array([m.load]), **how) for m in moved(steps)]
            total = shares @ sum(power[:, 0] for power, _ in looks)
            known[steps] = np.maximum(total, 1e-300), max(float(peak[0]) for _, peak in looks)
        return known[steps]

    start = np.zeros(2 * len(members))
    # the last variable stays below the power of every point
    rules = [lambda x: np.log(told(x)[0]) - x[-1]] if worst else []
    rules += [] if math.isinf(most) else [lambda x: math.log(most / max(told(x)[1], 1e-300))]
    scipy.optimize.minimize(
        (lambda x: -x[-1]) if worst else (lambda x: -math.log(told(x)[0][0])),
        np.append(start, np.log(told(start)[0]).min()) if worst else start,
        method="COBYLA",
        tol=LAST_STEP,
        constraints=[{"type": "ineq", "fun": rule} for rule in rules],
        options={"rhobeg": FIRST_STEP, "maxiter": MOST_STEPS * len(members)},
    )
    ranks = {x: float(p.min()) if over <= most else -over for x, (p, over) in known.items()}
    top = max(ranks, key=ranks.__getitem__)
    return moved(top), ranks[top]


def _moved(harvester: H, shift: float, factor: float) -> H:
    """Shift the natural frequency by so many damping ratios, and the load by a logarithm."""
    wanted = harvester.natural_frequency_hz * math.exp(harvester.damping_ratio * shift)
    tuned = harvester.retuned(float(np.clip(wanted, *harvester.frequency_range_hz)))
    return tuned.with_load(np.clip(harvester.load * math.exp(factor), *tuned.load_range))


def power_against_tuning(harvester: H, duty: Shaking, frequency_hz: npt.ArrayLike) -> Real:
    """Mean power [W] of the harvester retuned to each frequency, its load as it is.

    Parameters
    ----------
    frequency_hz : array, shape (n,)
        Within the range that the harvester can reach.
    """
    points, load = _lightened(harvester, check_duty(duty), FINE_BINS), np.array([harvester.load])
    wanted = np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))
    return np.array([mean_power_w(harvester.retuned(float(f)), points, load)[0] for f in wanted])


def bandwidth_against_quality(
    harvester: Harvester, quality_factors: Sequence[float], wander: float = 0.0
) -> list[dict[str, float]]:
    """Bandwidth and power of a harvester against the quality factor of its mechanics.

    Parameters
    ----------
    harvester : InertialHarvester, CoilHarvester or PiezoCantilever
        As tuned; its load is chosen anew for every quality factor.
    quality_factors : sequence of float, 0.51 to 10,000
        Of the mechanics alone, 1/(2 zm), dimensionless.
    wander : float, 0 to 0.2
        Standard deviation of the frequency of the one line of 1 m/s2 that drives it, over its mean.

    Returns
    -------
    list of dict
        quality_factor, loaded_quality_factor, load, width_hz, peak_power_w (1 m/s2 at the best
        frequency) and power_w (1 m/s2 about the natural frequency, wandering).

    Raises
    ------
    ArgumentError
        If a value is out of its range.
    """
    line = [harvester.natural_frequency_hz]
    points = check_duty(vibration_of_lines(line, acceleration_ms2=[1.0], wander=wander))
    rows = []
    for quality in quality_factors:
        check_range("quality_factor", quality, 0.51, 1e4)
        damped = harvester.with_damping_ratio(1 / (2 * quality))
        load, power = _best_load(damped, points)
        band = half_power_band(damped.with_load(load))
        row = {"quality_factor": float(quality), "loaded_quality_factor": band["quality_factor"]}
        row |= {"load": load, "width_hz": band["width_hz"]}
        rows.append(row | {"peak_power_w": band["power_w"], "power_w": power})
    return rows


def _best_load(harvester: Harvester, points: Points) -> tuple[float, float]:
    """Load that gives most as the harvester is tuned, and that power [W]."""

    def power_w(loads: Real) -> Real:
        return mean_power_w(harvester, points, loads)

    grid = np.geomspace(*harvester.load_range, LOADS)
    top = int(np.argmax(power_w(grid)))
    near = np.log([grid[max(top - 1, 0)], grid[min(top + 1, LOADS - 1)]])
    found = scipy.optimize.minimize_scalar(lambda x: -power_w(np.exp([x]))[0], bounds=near)
    return math.exp(found.x), -float(found.fun)


def beside_published(harvester: Harvester) -> list[dict[str, Any]]:
    """List harvesters that others have published, and what this one gives under the same.

    Parameters
    ----------
    harvester : InertialHarvester, CoilHarvester or PiezoCantilever
        Retuned to the frequency of each, with its best load.

    Returns
    -------
    list of dict
        name, source, checked ("abstract", or "no" of figures that could not be checked against
        their source), kind, frequency_hz, acceleration_ms2, load_ohm, volume_cm3, remark and
        power_uw as published; uw_per_cm3, that power over the volume and the squared acceleration
        [uW/cm3 at 1 m/s2]; model_uw, what the model of this package gives for the dimensions of the
        published one; own_uw and own_uw_per_cm3 of this one. None where it is not stated, not
        modelled or out of reach.

    Examples
    --------
    >>> from gearmon.harvesting import InertialHarvester
    >>> rows = beside_published(InertialHarvester(mass_kg=5e-3, natural_frequency_hz=100.0))
    >>> rows[0]["power_uw"], round(rows[0]["model_uw"]), rows[0]["checked"]
    (11950.0, 11896, 'no')
    """
    rows = []
    for one in cantilever.known()["published"]:
        row = dict.fromkeys(("load_ohm", "volume_cm3", "remark", "beam")) | one
        frequency, square = one["frequency_hz"], one["acceleration_ms2"] ** 2
        row["uw_per_cm3"] = one["power_uw"] / square / one.get("volume_cm3", math.nan)
        row |= {"model_uw": math.nan, "own_uw": math.nan, "own_uw_per_cm3": math.nan}
        if beam := row.pop("beam"):
            kinds = {"piezo": cantilever.PiezoMaterial, "passive": cantilever.BeamMaterial}
            parts = {part: kind(name="published", **beam[part]) for part, kind in kinds.items()}
            model = cantilever.PiezoCantilever(**beam | parts, load_ohm=one["load_ohm"])
            row["model_uw"] = 1e6 * square * float(model.gains(frequency).power_w[0])
        with suppress(ArgumentError):  # out of reach
            own = harvester.retuned(frequency)
            line = vibration_of_lines([frequency], acceleration_ms2=[one["acceleration_ms2"]])
            row["own_uw"] = 1e6 * _best_load(own, check_duty(line))[1]
            volume_cm3 = 1e6 * getattr(own, "volume_m3", math.nan)
            row["own_uw_per_cm3"] = row["own_uw"] / square / volume_cm3
        rows.append({name: None if own != own else own for name, own in row.items()})
    return rows


def _refusal(nearest: Tuned[Any]) -> str:
    """Name the nearest tuning, and how far it is over its limit."""
    one, wanted = nearest.harvester, "stress within {:.3g} MPa"
    limit = one.stress_limit_pa / 1e6
    does = "reaches {:.3g} MPa; use a thicker beam, or a lighter tip mass"
    if nearest.travel_share >= nearest.stress_share:
        limit, wanted = 1e3 * one.clearance_m, "mass within its clearance of {:.3g} mm"
        does = "travels {:.3g} mm; allow that, or a smaller mass"
    at = f"{one.natural_frequency_hz:.4g} Hz, {does.format(nearest.over * limit)}"
    return f"no tuning keeps the {wanted.format(limit)}: the nearest, {at}"


def _lightened(harvester: Harvester, points: Points, bins: float) -> Points:
    """Merge bins within a share of a resonance, and drop what no tuning can use."""
    # far below its range a harvester only follows; its third mode lies 30 times above the first
    low, high = np.array(harvester.frequency_range_hz) * (0.25, 40)
    kept = []
    for point in points:
        vibration = point.vibration
        loud = vibration.mean_square_m2s4 > 0
        heard = loud & (vibration.frequency_hz >= low) & (vibration.frequency_hz <= high)
        if not heard.any():
            raise ArgumentError(
                f"{vibration.name or 'vibration'}: nothing vibrates between {low:g} and {high:g} "
                f"Hz; it holds {vibration.frequency_hz[0]:g} to {vibration.frequency_hz[-1]:g} Hz"
            )
        heard_of = vibration.only(heard).merged(harvester.damping_ratio * bins)
        kept.append(replace(point, vibration=heard_of))
    return tuple(kept)


def _grid(harvester: Harvester, points: Points) -> Real:
    """Natural frequencies of the first look: even steps, and the loudest lines."""
    low, high = harvester.frequency_range_hz
    count = math.ceil(math.log(high / low) / (STEP * harvester.damping_ratio)) + 2
    even = np.geomspace(low, high, min(count, MOST_SCANNED))
    heard = [point.vibration for point in points]
    tops = [v.frequency_hz[np.argsort(-v.energy_j_per_kg)[:LOUDEST]] for v in heard]
    lines = np.concatenate(tops)
    # an open circuit may raise the natural frequency to a line
    middle = harvester.retuned(math.sqrt(low * high))
    raised = getattr(middle, "open_circuit_hz", middle.natural_frequency_hz)
    softer = lines * (middle.natural_frequency_hz / raised)
    return np.unique(np.clip(np.concatenate([even, lines, softer]), low, high))


def tune_set(harvester: H, duty: Shaking, count: int = 3) -> list[Tuned[H]]:
    """Best set of harvesters of one kind for the worst operating point, each with its own tuning.

    Found among tunings on a grid that no other beats at every operating point, and refined
    together. Powers add, since a harvester of a few grams does not move a gearbox and each has its
    own rectifier. For the mean over the duty cycle, copies of the best single one cannot be beaten.

    Parameters
    ----------
    harvester, duty
        As for `tune_harvester`.
    count : int, 1 to 3
        Size of the set.

    Returns
    -------
    list of Tuned

    Raises
    ------
    ArgumentError
        If an argument is out of its range, or as in `tune_harvester`.
    """
    if count not in (1, 2, 3):
        raise ArgumentError(f"count={count} must be 1, 2 or 3")
    points = check_duty(duty)
    best, most = _tuned(harvester, points, True)
    if len(points) == 1:
        return [best] * count
    rows = _rows(harvester, points)
    found = [own.with_load(load) for own, loads, _, over in rows for load in loads[over <= most]]
    powers = np.concatenate([power[:, over <= most] for *_, power, over in rows], axis=1).T
    # tunings that no other beats at every point: the best for the worst point when the points'
    # powers are wanted in some mixture
    mixtures = np.random.default_rng(0).dirichlet(np.ones(len(points)), MIXTURES)
    mixtures = np.maximum(mixtures * powers.max(axis=0), 1e-300)
    unbeaten = np.unique([np.argmax((powers / mixture).min(axis=1)) for mixture in mixtures])
    sets_of = np.array(list(combinations_with_replacement(unbeaten, count)))
    chosen = sets_of[powers[sets_of].sum(axis=1).min(axis=1).argmax()]
    light = _lightened(harvester, points, FINE_BINS)
    refined, _ = _polished([found[i] for i in chosen], light, np.eye(len(points)), most)
    group, same = [evaluate(one, points) for one in refined], [best] * count
    ours, copies = (np.array([[a.power_w for a in t.answers] for t in g]) for g in (group, same))
    better = ours.sum(axis=0).min() > copies.sum(axis=0).min()
    return group if better and all(tuned.within_limits for tuned in group) else same


GRAVITY_MS2 = 9.81
#: Units of keys that are a thousandth of those that a harvester takes.
_THOUSANDTHS = {"mm": "m", "g": "kg", "mh": "henry"}
#: What the words of a file stand for, by key.
_WORDS: dict[str, dict[str, Any]] = {
    "piezo": cantilever.PIEZO_MATERIALS,
    "passive": cantilever.BEAM_MATERIALS,
    "tip_block_material": cantilever.BEAM_MATERIALS,
    "air": {"included": False, "added": True},
}
_KINDS = {own.kind: own for own in (cantilever.PiezoCantilever, InertialHarvester, CoilHarvester)}


def built_in() -> tuple[Harvester, response.SensorBudget]:
    """Return the harvester and budget that are taken if no file is given.

    A bimorph of PZT-5A on brass, 15 x 10 x 0.6 mm, in series, its motion up and down: 70 Hz with
    20 g at the tip, 1.2 kHz bare.
    """
    return _built("cantilever", {}), response.SensorBudget()


def load_harvester(path: str | Path) -> tuple[Harvester, response.SensorBudget]:
    """Read a harvester file.

    Parameters
    ----------
    path : str or Path
        TOML as shown in the docstring of this module.

    Returns
    -------
    harvester, budget

    Raises
    ------
    MachineFileError
        If the file cannot be read, or a key is unknown or out of its range; with file and line.
    """
    source = read_source(path)
    kind = source.document.get("kind")
    if not isinstance(kind, str) or kind not in _KINDS:
        raise source.error("kind", f'kind = {kind!r} must be "cantilever" or "inertial" or "coil"')
    document = {key: own for key, own in source.document.items() if key not in ("kind", "budget")}
    keys = (*cantilever.known()[kind], _KINDS[kind].load_name)
    source.refuse_unknown_keys(document, keys)
    try:
        harvester = _built(kind, document)
    except FieldError as error:
        key = next((key for key in keys if _in_si(key)[0] == error.key), error.key)
        said = FieldError(key, error.reason, document.get(key, error.value)).message(key)
        raise source.error(key, said) from None
    except ArgumentError as error:
        raise source.error("kind", str(error)) from None
    return harvester, source.part(response.SensorBudget, "budget", source.table("budget"))


def _built(kind: str, given: dict[str, Any]) -> Harvester:
    """Build a harvester from the keys of its file; what is left out has its default."""
    table = cantilever.known()[kind] | given
    for key, options in _WORDS.items():
        if key in table:
            table[key] = options[Choice(options=tuple(options)).checked(key, table[key])]
    tilt = Number(low=0, high=90, unit="degrees").checked("tilt_deg", table.pop("tilt_deg"))
    values = dict(_in_si(key, value) for key, value in table.items())
    values["weight_ms2"] = GRAVITY_MS2 * math.cos(math.radians(tilt))
    values["load_kept"] = _KINDS[kind].load_name in values
    if kind == "cantilever":
        values["in_air"] = values.pop("air")
        values["tip_block_density_kg_m3"] = values.pop("tip_block_material").density_kg_m3
    else:
        ends = [FREQUENCY.checked(key, values[key]) for key in ("lowest_hz", "highest_hz")]
        values["natural_frequency_hz"] = math.sqrt(math.prod(ends))
    return _KINDS[kind](**values)


def _in_si(key: str, value: Any = 0.0) -> tuple[str, Any]:
    """Return the field of a harvester that a key stands for, and its value there."""
    name, _, unit = key.rpartition("_")
    if unit in _THOUSANDTHS:
        # the range is that of the field itself
        any_number = Number(low=-math.inf, high=math.inf)
        return f"{name}_{_THOUSANDTHS[unit]}", 1e-3 * any_number.checked(key, value)
    return {"damping_ratio": "mechanical_damping_ratio"}.get(key, key), value
