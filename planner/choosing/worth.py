"""By what touches are valued: what the axis would be known to after them, over the belief."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimator.belief import Belief, SampledObjects
from estimator.contact import SensorNoise
from estimator.information import contact_information, known_before, with_untold_rotation
from estimator.side_by_side import in_shares
from estimator.singular import margins
from estimator.surface import Geometry
from estimator.triple_scores import in_goals
from estimator.vectors import Array, Index
from hand_models.hand import Hand
from planner.choosing.pad_shapes import PadShapes, pad_shapes
from planner.choosing.prospects import BEHIND, Prospects, prospects, with_earlier
from planner.goal import Goal

DOUBTFUL_OBJECTS = 0.25  # share of the objects that may come nearer to a singularity


@dataclass(frozen=True, eq=False)
class Worth:
    """The belief, objects drawn from it, the sensor and the goal.

    Args:
        noise: Of the sensor, as it is told.
        height: Of the place along the believed axis where the offset counts, the later grasp's
            [m], from the axis' point.
        untold: Sd of a common rotation of the directions that the expected error reckons with
            beside what the sensor admits [rad]: the estimator will not know of it.
        pad: Radius of the hand's pads, or of the spheres that stand for them [m].
        hand: Whose pads touch, where a posture says how they lie.
    """

    belief: Belief
    samples: SampledObjects
    noise: SensorNoise
    goal: Goal
    height: float = 0.0
    untold: float = 0.0
    pad: float = 0.0
    hand: Hand | None = None

    @property
    def before(self) -> Array:
        """What is known already, in goals, (5, 5)."""
        return self._scaled(known_before(self.belief.covariance, self.noise.direction_offset))

    def landed(
        self, place: Geometry, shapes: PadShapes | None = None, *, behind: Array | float = BEHIND
    ) -> Prospects:
        """Touches planned at places (N, m), on each object; without shapes they are of balls."""
        return prospects(self.samples, place.p, place.n, pad=self.pad, shapes=shapes, behind=behind)

    def shapes(
        self, place: Geometry, fingers: Index, q: Array, R_WB: Array, *, carried: bool
    ) -> PadShapes | None:
        """Of the hand's pads that touch at places (N, m), see `pad_shapes`."""
        if self.hand is None:
            return None
        return pad_shapes(self.hand, fingers, q, R_WB, place.n, carried=carried)

    def information(self, landed: Prospects) -> Array:
        """Of each touch on each object, zero where it misses, in goals, (B, N, m, 5, 5)."""
        B, N, m = landed.theta.shape
        each = contact_information(landed.geometry, landed.points, landed.directions, self.noise)
        return self._scaled(each.reshape(B, N, m, 5, 5) * landed.hit[..., None, None])

    def covariances(self, landed: Prospects) -> Array:
        """Mean square errors after each candidate on each object, in goals, (B, N, 4, 4)."""
        told, before = self.information(landed), self.before
        after = np.empty((*told.shape[:2], 4, 4))

        def invert(part: slice) -> None:
            after[part] = with_untold_rotation(before + told[part].sum(axis=2), before, self.untold)

        in_shares(invert, len(after))
        return after

    def least_margins(self, landed: Prospects) -> Array:
        """Margin that three of four objects keep from each singularity, (N, K)."""
        return doubtful_margins(self.margins(landed))

    def margins(self, landed: Prospects) -> Array:
        """From each singularity on each object, (B, N, K).

        Of the triple that the touches make together with the contacts there already are; where
        more or fewer than three are in all, no triple has to be good: infinite, (B, N, 1).
        """
        earlier = np.array([c.position for c in self.belief.contacts]).reshape(-1, 3)
        triples = with_earlier(landed, self.samples, earlier)
        if triples is None:
            return np.full((*landed.theta.shape[:2], 1), np.inf)
        return margins(triples).values

    def _scaled(self, information: Array) -> Array:
        goal = self.goal
        return in_goals(information, angle=goal.angle, offset=goal.offset, height=self.height)


def doubtful_margins(margins: Array) -> Array:
    """Margins (B, N, K) that three of four objects keep, (N, K)."""
    quantile = np.quantile(margins, DOUBTFUL_OBJECTS, axis=0, method="lower")  # infinite ones stay
    return np.asarray(quantile)
