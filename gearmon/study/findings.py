"""What a claim is, and what holding it against computed results finds."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from gearmon.study.results import StudyResults

# Where an expected number comes from.
STUDY, CLOSED_FORM, INDEPENDENT = "study", "closed form", "independent computation"

Verdict = Literal["reproduced", "partly", "not reproduced", "cannot be checked"]


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """One number of ours, beside the published or otherwise expected one where there is any.

    Attributes
    ----------
    quantity : str
    ours : float
    unit : str
        Empty for a pure number.
    expected : float or None
        None where nothing is published to compare with.
    source : str
        Where `expected` comes from.
    tolerance : float
        Relative difference that the digits of the source allow.
    """

    quantity: str
    ours: float
    unit: str = ""
    expected: float | None = None
    source: str = ""
    tolerance: float = 0.01

    @property
    def difference(self) -> float | None:
        """Ours over the expected less one; the plain difference where zero is expected."""
        if self.expected is None:
            return None
        if self.expected == 0:
            return self.ours
        return self.ours / self.expected - 1

    @property
    def agrees(self) -> bool:
        """Whether the difference is within the tolerance; True where nothing is expected."""
        return self.difference is None or abs(self.difference) <= self.tolerance


@dataclass(frozen=True, kw_only=True)
class Finding:
    """What the results say of one claim.

    Attributes
    ----------
    verdict : str
    reason : str
        One or two sentences with the numbers that decide.
    evidence : tuple of Evidence
    """

    verdict: Verdict
    reason: str
    evidence: tuple[Evidence, ...]


@dataclass(frozen=True, kw_only=True)
class Claim:
    """One claim of the study.

    Attributes
    ----------
    key : str
        Number and letter: "6b".
    text : str
        What is claimed, in our words.
    where : str
        Equations or figures of the study.
    evaluate : callable
        StudyResults -> Finding.
    """

    key: str
    text: str
    where: str
    evaluate: Callable[[StudyResults], Finding]


@dataclass(frozen=True, kw_only=True)
class Judged:
    """A claim with its finding."""

    claim: Claim
    finding: Finding


def verdict_of(*parts: bool) -> Verdict:
    """Reproduced if all parts hold, partly if some do, else not reproduced."""
    if all(parts):
        return "reproduced"
    return "partly" if any(parts) else "not reproduced"


def rising(values: Sequence[float], slack: float = 0.0) -> bool:
    """Whether no value falls by more than the share `slack` of the one before."""
    return all(b >= a * (1 - slack) for a, b in itertools.pairwise(values))


def falling(values: Sequence[float], slack: float = 0.0) -> bool:
    """Whether no value rises by more than the share `slack` of the one before."""
    return all(b <= a * (1 + slack) for a, b in itertools.pairwise(values))


def chain(values: Sequence[float], digits: str = ".3g") -> str:
    """Write a row of numbers as one text.

    Examples
    --------
    >>> chain([646.1, 388.2], ".0f")
    '646 → 388'
    """
    return " → ".join(format(value, digits) for value in values)
