r"""Harvesting: where to put a vibration energy harvester, how to tune it, what it will power.

A harvester is linear (`InertialHarvester`, `CoilHarvester`, `PiezoCantilever`): its power and peaks
under a recording are the recording through its filter, lines and noise alike. Before there is a
recording, and for the search, the mean square of the acceleration by frequency stands for it:

    P = sum over lines of 2 G(f_i) <a_i^2>,    G the mean power per squared amplitude

Examples
--------
>>> from gearmon.harvesting import BEAM_MATERIALS, PIEZO_MATERIALS, PiezoCantilever, SensorBudget
>>> from gearmon.harvesting import tune_harvester, vibration_of_lines
>>> shaking = vibration_of_lines(
...     [633.0, 1266.0, 1899.0], acceleration_ms2=[4.0, 6.0, 2.0], wander=0.005
... )
>>> bimorph = PiezoCantilever(
...     wiring="series", piezo=PIEZO_MATERIALS["PZT-5A"], passive=BEAM_MATERIALS["brass"],
...     length_m=15e-3, width_m=10e-3, passive_thickness_m=0.2e-3, piezo_thickness_m=0.2e-3,
... )
>>> tuned = tune_harvester(bimorph, shaking)
>>> round(tuned.harvester.natural_frequency_hz), tuned.within_limits
(610, True)
>>> SensorBudget(sleep_power_w=0.1e-6).interval_s(tuned.power_w) < 86400   # a recording a day
True
>>> from gearmon.harvesting import CoilHarvester, InertialHarvester, OperatingShare
>>> from gearmon.harvesting import Survey, Tuned, Vibration, bandwidth_against_quality
>>> from gearmon.harvesting import beside_published
>>> from gearmon.harvesting import evaluate, load_harvester, power_with_stops, response_rows
>>> from gearmon.harvesting import survey_expected, survey_measured, tune_set, vibration_of_samples
>>> from gearmon.harvesting import vibration_of_signature
>>> spring = InertialHarvester(
...     mass_kg=5e-3, natural_frequency_hz=564.0, lowest_hz=500.0, highest_hz=650.0
... )
>>> found = survey_expected(machine, spring)
>>> isinstance(found, Survey), isinstance(found.best.tuned, Tuned)
(True, True)
>>> heard = gearmon.read_recording(full).select("a1")
>>> [row["position"] for row in survey_measured(machine, spring, [heard]).rows()]
['a1']
>>> lines = vibration_of_signature(gearmon.expected_signature(machine, max_hz=2000.0), gain=0.1)
>>> sound = heard.samples[0, :4000], heard.sampling_rate_hz
>>> sampled = vibration_of_samples(*sound)
>>> isinstance(lines, Vibration), evaluate(spring, sampled).power_w > 0
(True, True)
>>> duty = [OperatingShare(vibration=own, share=0.5) for own in (lines, sampled)]
>>> len(tune_set(spring, duty, 2))
2
>>> bandwidth_against_quality(spring, [50.0])[0]["quality_factor"]
50.0
>>> {row["kind"] for row in beside_published(bimorph)} == {"cantilever", "coil"}
True
>>> round(max(response_rows(spring), key=lambda row: row["power_w"])["frequency_hz"])
564
>>> stopped = InertialHarvester(mass_kg=5e-3, natural_frequency_hz=564.0, clearance_m=1e-6)
>>> power_with_stops(stopped, *sound) < evaluate(spring, sampled).power_w
True
>>> coil = CoilHarvester(
...     mass_kg=5e-3, natural_frequency_hz=564.0, turns=300, field_length_tm=0.01, coil_ohm=50.0
... )
>>> coil.transduction_n_per_a
3.0
>>> with open("harvester.toml", "w") as file:
...     _ = file.write('kind = "inertial"\nmass_g = 5.0\n')
>>> load_harvester("harvester.toml")[0].mass_kg
0.005

The modules inside: `vibration` (what shakes), `harvester` (what all are; springs and coils),
`cantilever` (piezoelectric beams), `response` (what they make of it, and what a sensor gets),
`tuning` (one and sets; the file of a harvester) and `placement` (where to put it).
"""

from gearmon.lazy import lazily

_OFFERED = {
    "cantilever": ("BEAM_MATERIALS", "PIEZO_MATERIALS", "PiezoCantilever"),
    "harvester": ("CoilHarvester", "InertialHarvester", "half_power_band", "response_rows"),
    "placement": ("Survey", "survey_expected", "survey_measured"),
    "response": ("SensorBudget", "Tuned", "evaluate", "power_with_stops"),
    "tuning": (
        *("bandwidth_against_quality", "beside_published", "load_harvester"),
        *("tune_harvester", "tune_set"),
    ),
    "vibration": (
        "OperatingShare",
        "Vibration",
        "vibration_of_lines",
        "vibration_of_samples",
        "vibration_of_signature",
    ),
}
__all__, __getattr__ = lazily(__name__, _OFFERED)
