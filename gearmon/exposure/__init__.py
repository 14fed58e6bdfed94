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

from gearmon.lazy import offered_to_checkers

TYPE_CHECKING = False  # see `gearmon.lazy`
if TYPE_CHECKING:
    from gearmon.exposure.day import DayExposure as DayExposure
    from gearmon.exposure.day import DayPlan as DayPlan
    from gearmon.exposure.day import Job as Job
    from gearmon.exposure.day import exposure_day as exposure_day
    from gearmon.exposure.day import load_day as load_day
    from gearmon.exposure.day import sum_up as sum_up
    from gearmon.exposure.gearbox import GearShare as GearShare
    from gearmon.exposure.gearbox import gear_share as gear_share
    from gearmon.exposure.measures import LIMITS as LIMITS
    from gearmon.exposure.measures import POSITIONS as POSITIONS
    from gearmon.exposure.measures import Exposure as Exposure
    from gearmon.exposure.measures import Limits as Limits
    from gearmon.exposure.measures import SeatFactor as SeatFactor
    from gearmon.exposure.measures import seat_factor as seat_factor
    from gearmon.exposure.measures import vibration_exposure as vibration_exposure
    from gearmon.exposure.weighting import WEIGHTINGS as WEIGHTINGS
    from gearmon.exposure.weighting import Weighting as Weighting
    from gearmon.exposure.weighting import frequency_weighting as frequency_weighting

__all__, __getattr__ = offered_to_checkers(__name__, __file__)
