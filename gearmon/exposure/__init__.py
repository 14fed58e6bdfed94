r"""Exposure: what people on a machine feel of its vibration, by ISO 2631-1 and ISO 5349-1.

The rooms inside: `weighting` (what the body feels of which frequency), `measures` (one recording:
rms, running rms, dose value, advice), `day` (several jobs, limits, how sure) and `gearbox` (what
shafts, meshes and their damage have to do with it).

Examples
--------
>>> from gearmon.exposure import DayExposure, DayPlan, Exposure, GearShare, Job, Limits, SeatFactor
>>> from gearmon.exposure import LIMITS, POSITIONS, WEIGHTINGS, Weighting, frequency_weighting
>>> from gearmon.exposure import gear_share, load_day, seat_factor, sum_up, vibration_exposure
>>> known = {"sampling_rate_hz": 1000.0, "unit": "m/s2"}
>>> shaking = np.sin(2 * np.pi * 10**0.6 * np.arange(60_000) / 1000.0)
>>> felt = vibration_exposure(shaking, "seat", {"z": 1}, **known)
>>> isinstance(felt, Exposure), felt.value_axis, round(felt.value_ms2, 2)
(True, 'z', 0.68)
>>> isinstance(seat_factor(felt, felt), SeatFactor), LIMITS["seat"].action_ms2, "hand" in POSITIONS
(True, 0.5, True)
>>> plan = DayPlan(jobs=(Job(name="mowing", recording="mowing.csv", hours=8.0),))
>>> day = sum_up(plan, [[felt]])
>>> isinstance(day, DayExposure), day.flagged, day.rows()[0]["name"]
(True, True, 'mowing')
>>> sum_up(DayPlan(jobs=plan.jobs, limits=Limits(action_ms2=1.0, limit_ms2=2.0)), [[felt]]).flagged
False
>>> with open("day.toml", "w") as file:
...     _ = file.write('[[job]]\nname = "mowing"\nrecording = "mowing.csv"\nhours = 4.0\n')
>>> load_day("day.toml").jobs[0].hours
4.0
>>> weighting = frequency_weighting("Wk")
>>> isinstance(weighting, Weighting), "Wh" in WEIGHTINGS, weighting.error(1000.0) < 0.15
(True, True, True)
>>> felt = vibration_exposure(new, "hand", {"x": "a1", "y": "a2"})
>>> isinstance(gear_share(new, felt, machine), GearShare)
True
"""

from gearmon.lazy import lazily

_OFFERED = {
    "day": ("DayExposure", "DayPlan", "Job", "exposure_day", "load_day", "sum_up"),
    "gearbox": ("GearShare", "gear_share"),
    "measures": (
        "LIMITS",
        "POSITIONS",
        "Exposure",
        "Limits",
        "SeatFactor",
        "seat_factor",
        "vibration_exposure",
    ),
    "weighting": ("WEIGHTINGS", "Weighting", "frequency_weighting"),
}
__all__, __getattr__ = lazily(__name__, _OFFERED)
