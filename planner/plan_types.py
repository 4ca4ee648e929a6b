"""What a plan is: probes of one placement of the hand, with reasons and certificates."""

from __future__ import annotations

from dataclasses import dataclass

from estimator.bounds import AxisBound
from estimator.contact import Contact
from estimator.surface import Place
from estimator.vectors import Array
from planner.choosing.optimum import ChoiceCertificate
from planner.choosing.risk import Risk
from planner.funnel import Funnel, in_words
from planner.motions.motion import Approach
from planner.motions.retreat import Retreat
from planner.motions.round_motion import RoundMotion
from planner.reaching.reach import Reach


@dataclass(frozen=True, eq=False)
class Probe:
    """One touch to make.

    Args:
        finger: Which finger.
        place: Where on the believed surface.
        expected: The contact if the object is as believed (first row the parallel's).
        q: Joint positions with the pad on the contact [rad].
        approach: The way there, and beyond, should the object be farther away.
    """

    finger: str
    place: Place
    expected: Contact
    q: Array
    approach: Approach


@dataclass(frozen=True, eq=False)
class Plan:
    """Probes of one placement of the hand, in order, and why these.

    Args:
        probes: One for each finger that touches.
        reach: Joint angles and base pose with all pads on their contacts, certified.
        bound: Worst case of the axis from the best pair of the probes.
        covariance: Of the axis after the probes, if the object is as believed, (4, 4).
        angle, offset: Expected error of the axis after them, over the belief [rad], [m].
        margin: From the nearest singularity, in three of four objects; inf below three contacts.
        nearest: That singularity in words.
        label_probability: That the labels come out right; NaN where it was not computed.
        funnel: How many candidates there were, and what refused the others.
        retreat: The hand's way out after the probes.
        risks: What is at least 5 % likely to leave the axis untold, the likeliest first.
        choice: How good these touches are among all that there are; None where not asked.
        motion: All that the hand does, in time; None where it was not told where the hand is.
    """

    probes: tuple[Probe, ...]
    reach: Reach
    bound: AxisBound
    covariance: Array
    angle: float
    offset: float
    margin: float
    nearest: str
    label_probability: float
    funnel: Funnel
    retreat: Retreat
    risks: tuple[Risk, ...] = ()
    choice: ChoiceCertificate | None = None
    motion: RoundMotion | None = None

    def chance_of(self, name: str) -> float:
        """Of a risk that `planner.choosing.risk` names; 0 where it is not worth saying."""
        return next((risk.chance for risk in self.risks if risk.name == name), 0.0)


class NoPlan(Exception):
    """Nothing that this hand reaches would do.

    Attributes:
        funnel: What refused the candidates, with counts, in order.
    """

    def __init__(self, funnel: Funnel) -> None:
        self.funnel = funnel
        super().__init__(
            f"no placement of the hand makes good contacts: {in_words(funnel)}. A wider pad "
            "cone, a larger workspace, or an object nearer to the hand would help"
        )
