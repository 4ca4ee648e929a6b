"""When touches contradict earlier ones: the object moved, or keeps moving.

Contacts before and after a placement of the hand are read apart, each with what was believed
before any touch. Two axes of one object agree within their covariances, so the squared distance of
the two in the chart is chi-square with four degrees of freedom. To that come the distances of the
later contacts from the wall that the earlier ones led to expect, one more degree each
(`planner.off_the_wall`).
The fit of all contacts together is the other test: it sees what goes on within a placement, and
less between two, where the profile gives way.

What is done about it: earlier contacts count only as a belief, widened by the motion; and where
contacts keep contradicting each other, each counts as worse placed by as much as the object moves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc  # scipy.stats takes half a second to import

from estimator.axis import Axis, chart_coordinates, chart_lines, to_chart
from estimator.band import ProfileBand
from estimator.belief import Belief, update
from estimator.contact import Contact, Miss
from estimator.estimate import Hypothesis
from estimator.prior import AxisPrior
from estimator.vectors import Array, frozen
from planner.off_the_wall import off_the_wall

FEIGNED = 10.0  # real readings fit a little worse than their model: their p-value counts so often
ALARM = 0.03  # probability of a false alarm at a placement, were all models exact
AGREES = 0.1  # from where later touches confirm earlier ones; below, nothing is confirmed any more
MENTIONED = 0.01  # hypotheses that may be the right one
RESTLESS = 3  # surprises from which the object counts as moving all the time
LEAST_MOTION = (3e-3, float(np.deg2rad(3.0)))  # rms by which a belief is widened [m], [rad]


@dataclass(frozen=True, eq=False)
class Motion:
    """By how much the object seems to have moved between earlier and later contacts.

    Args:
        shift: Of the axis beside the middle of what was touched [m].
        tilt: Of its direction [rad].
        p_value: How often an object at rest would seem to move as much.
    """

    shift: float
    tilt: float
    p_value: float

    @property
    def words(self) -> str:
        return (
            f"the last contacts put the axis {1e3 * self.shift:.1f} mm and "
            f"{np.rad2deg(self.tilt):.1f} deg from where the earlier ones had it "
            f"(p = {self.p_value:.0e}): the object moved, or a reading is wrong"
        )


@dataclass(frozen=True, eq=False)
class Learnt:
    """What is believed, and whether the touches hang together.

    Args:
        belief: What is held true.
        agreeing: Later touches that agreed with earlier ones, since the last that did not.
        surprise: What the last touches contradicted and what was done; None where nothing.
        surprises: How often that happened.
        restless: By how much every contact counts as worse placed [m]: at first the slack that was
            told of, more where contacts keep contradicting each other.
    """

    belief: Belief
    agreeing: int = 0
    surprise: str | None = None
    surprises: int = 0
    restless: float = 0.0

    @property
    def settled(self) -> bool:
        """Whether enough touches agree: a goal met by touches that nothing confirmed does not
        count, and of an object that moved once, twice, ... one, three, ... have to."""
        return self.agreeing >= max(1, 2 * self.surprises - 1)


def learn(known: Learnt, outcomes: Sequence[Contact | Miss]) -> Learnt:
    """What is known after one placement's touches, contradictions answered."""
    felt = tuple(_as_sure(touch, known.restless) for touch in outcomes)
    belief = update(known.belief, felt)
    motion = motion_between(known.belief, belief, felt)
    if motion is None or motion.p_value > ALARM:
        agreeing = _agreeing(known, motion, felt)
        return replace(known, belief=belief, agreeing=agreeing, surprise=None)
    surprises, restless = known.surprises + 1, known.restless
    words = f"{motion.words}. Earlier contacts now count only as a wider prior"
    if surprises >= RESTLESS:
        restless = max(restless, motion.shift, LEAST_MOTION[0])
        felt = tuple(_as_sure(touch, restless) for touch in outcomes)
        words = f"{words}; it keeps happening, so contacts count as {1e3 * restless:.0f} mm worse"
    belief = after_motion(known.belief, felt, motion)
    return Learnt(belief, 0, words, surprises, restless)


def _agreeing(known: Learnt, motion: Motion | None, felt: Sequence[Contact | Miss]) -> int:
    """Touches that agree by now; a doubtful one takes them back, one that says nothing does not."""
    if motion is None:
        return known.agreeing
    if motion.p_value <= AGREES:
        return 0
    return known.agreeing + sum(isinstance(touch, Contact) for touch in felt)


def motion_between(before: Belief, after: Belief, later: Sequence[Contact | Miss]) -> Motion | None:
    """The motion that later touches show, however little; None where they can show none.

    Args:
        before: With two contacts or more: fewer say too little of an axis.
        after: The belief that takes earlier and later touches for those of an object at rest.
        later: Touches made since.
    """
    contacts = [touch for touch in later if isinstance(touch, Contact)]
    if len(before.contacts) < 2 or not contacts or after.estimate is None:
        return None
    alone = update(_untouched(before), contacts)
    pairs = [
        _distance(a, b)
        for a in before.hypotheses
        for b in alone.hypotheses
        if min(a.probability, b.probability) > MENTIONED
    ]
    if not pairs:
        return None
    square, x = min(pairs, key=lambda pair: pair[0])
    from_wall, count = off_the_wall(before, contacts)
    p_value = min(float(chdtrc(4 + count, square + from_wall)), FEIGNED * after.estimate.p_value)
    return Motion(float(np.hypot(*x[:2])), float(np.hypot(*x[2:])), p_value)


def _untouched(belief: Belief) -> Belief:
    """What was believed before any touch."""
    start = Hypothesis(belief.prior.axis, belief.prior.covariance, 1.0, 0.0, frozen(np.zeros(0)))
    return Belief(belief.prior, belief.prior_band, (start,), belief.prior_band)


def _distance(a: Hypothesis, b: Hypothesis) -> tuple[float, Array]:
    """Squared distance of two axes in their own deviations, and their difference."""
    x = to_chart(a.axis, b.axis)
    total = a.covariance + _carried(a.axis, b)
    return float(x @ np.linalg.solve(total, x)), x


def _carried(reference: Axis, other: Hypothesis) -> Array:
    """The covariance of another axis in the chart at the reference, by differences."""
    step = np.sqrt(np.diag(other.covariance)) * 1e-3
    origin, u = other.axis.point, other.axis.direction
    lines = chart_lines(origin, u, np.vstack([np.diag(step), -np.diag(step)]))
    x = chart_coordinates(reference.point, reference.direction, *lines)
    J = ((x[:4] - x[4:]) / (2.0 * step[:, None])).T
    return np.asarray(J @ other.covariance @ J.T)


def after_motion(before: Belief, later: Sequence[Contact | Miss], motion: Motion) -> Belief:
    """The belief after the object moved: earlier contacts only as a widened prior.

    What they told of the profile is kept as the likeliest shape, as doubtful as before any touch:
    it was read about an axis that may never have been the object's.
    """
    shift, tilt = max(motion.shift, LEAST_MOTION[0]), max(motion.tilt, LEAST_MOTION[1])
    widened = before.covariance + 0.5 * np.diag([shift, shift, tilt, tilt]) ** 2
    prior = AxisPrior(before.axis, widened, before.prior.radius, before.prior.radius_sd)
    doubted = replace(before.band, covariance=before.prior_band.covariance)
    band = _shifted(doubted, shift, tilt)
    start = Hypothesis(prior.axis, prior.covariance, 1.0, 0.0, frozen(np.zeros(0)))
    return update(Belief(prior, band, (start,), band), later)


def _shifted(band: ProfileBand, shift: float, tilt: float) -> ProfileBand:
    """The band about an axis that may have moved, the object sliding along it as well."""
    slope = np.gradient(band.mean, band.z)
    arm = band.z - band.z.mean()
    slid = shift**2 * np.outer(slope, slope) + shift**2 + tilt**2 * np.outer(arm, arm)
    return replace(band, covariance=frozen(band.covariance + slid))


def _as_sure(touch: Contact | Miss, by: float) -> Contact | Miss:
    """The touch with its position less sure by `by` [m] in each coordinate."""
    if by == 0.0 or isinstance(touch, Miss):
        return touch
    contact = touch
    noise = replace(contact.noise, position=float(np.hypot(contact.noise.position, by)))
    if contact.covariance is None:
        return replace(contact, noise=noise)
    covariance = contact.covariance + np.diag([by**2] * 3 + [0.0] * 5)
    return replace(contact, noise=noise, covariance=covariance)
