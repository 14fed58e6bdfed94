"""What tracking takes for a pulse, a clear line, a slip: all its thresholds in one place.

Each divides cases that the tests beside it hold apart: `test_phases` and `test_speed_tracking`
(simulated gears whose speed wanders, jumps and ramps, in noise), `test_slips` (angles with slips of
whole mesh periods planted, lines that fade, paths that ring), `test_pulse_repair` and
`test_uneven_pulses` (trains with pulses taken out, put in and moved, at changing speeds),
`test_tacho_phases` (edges that jitter or are quantised by the sampling).
"""

from __future__ import annotations

from dataclasses import dataclass

#: Hann blocks a quarter of their length apart that are worth an independent one in a mean: 1 + 2
#: (0.659 + 0.167 + 0.008), by the correlations of such blocks (Harris 1978).
QUARTER_HOP = 2.7


@dataclass(frozen=True, kw_only=True)
class Thresholds:
    """Thresholds of pulses, phases and slips; turns are those of shaft 1."""

    # --- order lines
    # power over noise from which the phase of a line counts
    clear_power: float = 6.0
    # phase noise that modulation and interference leave on even the clearest line, against its own
    # slow mean [cycles]
    floor_cycles: float = 0.005
    # a vote for the angle further than this from the consensus has slipped [cycles]
    slipped_cycles: float = 0.25
    # restlessness of a speed that is locked to lines: standard deviation of its relative change in
    # one second
    wander: float = 0.02
    # relative distance of speeds at which a line has a mean of its own: the path turns it between
    speed_class: float = 0.04

    # --- slips of an angle against its lines
    # phase scatter of a line that counts [cycles], and the share of its usual strength below which
    # its mean is no measure of it
    clear_cycles: float = 0.12
    faint: float = 0.3
    # coherence below which an angle is lost, and up to which a lost stretch reaches
    lost: float = 1 / 3
    sound: float = 0.6
    # where the coherence is below the first for more than a tenth of the time, the lines fade by
    # themselves, as those of real gears do for a turn or two: shorter stretches than the second
    # [turns] are then no sign of a slip
    steady_lines: float = 0.75
    fading_turns: float = 5.0
    # lost stretches nearer to one another are one, and over longer ones no displacement is looked
    # for [turns]
    apart_turns: float = 6.0
    longest_turns: float = 200.0
    # longer ones are not led over [turns]
    mendable_turns: float = 20.0
    # largest error of the speed while the angle is lost
    astray: float = 0.06
    # group delay of a housing [s] where lines do not tell it: half a cycle for each mode, some two
    # a kilohertz, of which the zeros between modes give half back; and the part of its error that
    # does not go with the departure of the speed from its mean
    delay_s: float = 5e-4
    steady_delay: float = 0.25
    # lines before and after a lost stretch: over how many turns at most and at least, what the
    # speed may turn them by [cycles], and the log likelihood by which one displacement must outdo
    # others
    beside_turns: float = 40.0
    least_turns: float = 12.0
    turned_cycles: float = 0.05
    told: float = 5.0

    # --- pulses of a tachometer
    # fewest pulses that are believed, and the share of them that may be repaired
    fewest_pulses: int = 4
    repairable: float = 0.02
    # how far a nominal speed may be off
    nominal: float = 0.03
    # intervals over the typical one below which a pulse is extra, and from which on some are
    # missing
    short: float = 0.6
    long: float = 1.5
    # how far off the cubic through its neighbours a pulse may be: smaller intervals beside it, and
    # robust deviations
    off: float = 0.08
    deviations: float = 8.0
    # share of pulses that are repaired from which on a train is only counted
    hopeless: float = 0.1
    # how far from its place a pulse may come, as a share of the smaller interval beside it,
    # and how far the shares of a turn may differ for pulses to be called even
    early_or_late: float = 0.35
    even: float = 0.05

    # --- pulses and lines together
    # fewest pulses and turns: below, no mean of a line stands for anything
    pulses: int = 16
    turns: float = 16.0
    # twice the log likelihood that a drift of the lines must gain to be believed: chance gains as
    # much in one recording of a thousand, half of chi square of one degree of freedom
    drift: float = 10.0
    # coherence of the fractions of a sample by which edges advance a turn, from which on
    # quantisation beats with the rotation and passes for a drift; of white ones 200 turns give 0.07
    beats: float = 0.25
    # pulses over which the angle must keep to their mean, and standard deviations of that mean
    mean_of: int = 25
    mean_deviations: float = 4.0


LIMITS = Thresholds()
