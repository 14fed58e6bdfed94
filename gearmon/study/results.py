"""The whole study, computed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from gearmon.study.applications import (
    DamageStudy,
    HarvestStudy,
    study_damage,
    study_harvest,
)
from gearmon.study.contact import ContactStudy, study_contact
from gearmon.study.expansion import OrderStudy, study_orders
from gearmon.study.reference_case import REFERENCE, DecodedGears, decoded
from gearmon.study.responses import FormResponse, form_responses
from gearmon.study.speed import SpeedStudy, study_speed
from gearmon.study.sweeps import Operation, Sweep, operate, run_sweeps

QUICK_TOLERANCES = (1e-2, 1e-6)


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyResults:
    """Everything that is drawn, tabulated and held against the claims.

    Attributes
    ----------
    gears : DecodedGears
    forms : dict of str to FormResponse
        The reference case under each form of stiffness.
    reference : Operation
        The reference case.
    sweeps : dict of str to Sweep
        By parameter: stiffness_n_per_m, mass_kg, damping_ns_per_m.
    orders : OrderStudy
    contact : ContactStudy
    damage : DamageStudy
    harvest : HarvestStudy
    speed : SpeedStudy
    """

    gears: DecodedGears
    forms: dict[str, FormResponse]
    reference: Operation
    sweeps: dict[str, Sweep]
    orders: OrderStudy
    contact: ContactStudy
    damage: DamageStudy
    harvest: HarvestStudy
    speed: SpeedStudy


def run_study(progress: Callable[[float], None] | None = None, quick: bool = False) -> StudyResults:
    """Compute the whole study, in about 20 s.

    Parameters
    ----------
    progress : callable, optional
        Called with the share done, 0 to 1.
    quick : bool
        Scan contact more coarsely and time fewer simulations, once each; all else is the same.
    """

    def done(share: float) -> None:
        if progress is not None:
            progress(share)

    forms = form_responses()
    done(0.25)
    sweeps = run_sweeps(lambda share: done(0.25 + 0.3 * share))
    orders = study_orders()
    contact = study_contact(every=4 if quick else 1)
    done(0.75)
    reference = operate(REFERENCE)
    damage = study_damage(forms["fourier-half"].signal)
    harvest = study_harvest(reference.response)
    speed = study_speed(1, QUICK_TOLERANCES) if quick else study_speed()
    done(1.0)
    return StudyResults(
        gears=decoded(),
        forms=forms,
        reference=reference,
        sweeps=sweeps,
        orders=orders,
        contact=contact,
        damage=damage,
        harvest=harvest,
        speed=speed,
    )
