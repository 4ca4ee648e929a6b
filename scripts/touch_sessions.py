"""One session of touches by the hand, judged against the truth, for the benchmark of touches.

Every arm meets the same object, the same wrong belief, the same sensor and seed.

    planned   the planner as it is
    rule      placements in order of the paper's bound for the best pair: 90 degrees apart
    random    any placement the hand reaches
    oracle    the first placement is planned by somebody who knows the object, over many more
              placements; the estimate starts from the same belief as the others'
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from honesty import FOUR_SIGMA
from scenarios import draw_shapes

from estimator.axis import Axis, angle_between, offset_at, to_chart
from estimator.band import ProfileBand
from estimator.belief import Belief, SampledObjects, update
from estimator.contact import Contact, Miss, SensorNoise
from estimator.profile import SplineProfile
from estimator.readings import UMBILIC
from estimator.sensors import sensor_noise
from estimator.singular import margins, placed_triples
from estimator.surface import SurfaceOfRevolution
from estimator.vectors import Index, frozen
from hand_models import load_hand
from hand_models.hand import Hand
from planner.candidates import Candidates
from planner.choosing.choice import Ranking
from planner.choosing.worth import Worth
from planner.explore import Step, explore
from planner.goal import Goal
from planner.options import Criterion, PlannerOptions
from planner.plan import NoPlan, Preference, Probe, plan_preferred, plan_probes
from sim_sensor.camera import coarse_view
from sim_sensor.noise import Session as SensorSession
from sim_sensor.noise import simulated_sensor
from sim_sensor.world import TouchRecord, World

ARMS: dict[str, Criterion] = {
    "planned": "information", "rule": "pair-bound", "random": "random", "oracle": "information",
}  # fmt: skip
SETTINGS = ("coarse", "weak", "offset", "told")
OFFSET = float(np.deg2rad(8.0))
GOAL = Goal(float(np.deg2rad(3.0)), 2e-3)
RADII = (0.018, 0.045)  # of the objects at half height [m]
ORACLE_PLACEMENTS = 2400
_NODES = 61  # of a drawn profile


@dataclass(frozen=True)
class Job:
    """Which session."""

    hand: str
    sensor: str
    setting: str
    arm: str
    family: str
    seed: int
    budget: int


@dataclass(frozen=True)
class Outcome:
    """What came of it; errors are of the likeliest axis, NaN where nothing was felt.

    Args:
        first_touches: Made until three contacts or more were felt, in whole placements.
        first_deg, first_mm: Then.
        labels, labels_soon: Whether their labels were right then, and if not, after the next touch
            or placement.
        margin: Of the first three contacts on the true object, from the nearest singularity [-].
        second_deg, second_mm: After one more placement of three.
        touches, placements: Until the goal was met, or all there were.
        met, verdict, wrong: How the session ended; wrong where it was determined and beyond four
            standard deviations or twice the goal.
        plan_seconds: Of the first plan.
        why: Why the goal was not met.
    """

    job: Job
    first_touches: int = 0
    first_deg: float = np.nan
    first_mm: float = np.nan
    labels: bool = False
    labels_soon: bool = False
    margin: float = np.nan
    second_deg: float = np.nan
    second_mm: float = np.nan
    touches: int = 0
    placements: int = 0
    met: bool = False
    verdict: str = "undetermined"
    wrong: bool = False
    plan_seconds: float = np.nan
    why: str = ""


def drawn_object(family: str, rng: np.random.Generator) -> SurfaceOfRevolution:
    """An object of the family standing about 0.5 m in front of the origin, a little tilted."""
    shapes = draw_shapes(family, 1, rng=rng, radii=RADII)
    low, high = shapes.z_range
    z = np.linspace(low, high, _NODES)
    profile = SplineProfile(z, shapes.derivatives(z[None])[0][0])
    axis = Axis([0.5, 0.0, 0.2], [0.2 * rng.normal(), 0.2 * rng.normal(), 1.0])
    return SurfaceOfRevolution(axis, profile)


def run(job: Job) -> Outcome:
    """One session."""
    rng = np.random.default_rng([job.seed, 7])
    surface = drawn_object(job.family, rng)
    belief = _belief(surface, job.setting, rng)
    told = sensor_noise(job.sensor)
    common = OFFSET if job.setting in ("offset", "told") else None
    session = simulated_sensor(job.sensor).session(rng=rng, direction_offset=common)
    world = World(surface, session, rng=rng, hand=_hand(job.hand))
    if job.setting == "told":
        told = replace(told, direction_offset=OFFSET)
    return _Session(job, surface, session, world, told).run(belief)


def _belief(surface: SurfaceOfRevolution, setting: str, rng: np.random.Generator) -> Belief:
    """Wrong by 15 deg and 15 mm; weak: by up to 60 deg and 40 mm."""
    if setting != "weak":
        return coarse_view(surface, angle=np.deg2rad(15.0), offset=0.015, rng=rng)
    angle = np.deg2rad(60.0) * np.sqrt(rng.uniform(0.01, 1.0))
    return coarse_view(surface, angle=angle, offset=0.04 * rng.uniform(0.1, 1.0), rng=rng)


@lru_cache
def _hand(name: str) -> Hand:
    return load_hand(name)


@dataclass(frozen=True, eq=False)
class _Session:
    job: Job
    surface: SurfaceOfRevolution
    session: SensorSession
    world: World
    told: SensorNoise

    def run(self, belief: Belief) -> Outcome:
        outcome = Outcome(self.job)
        rng, start = np.random.default_rng([self.job.seed, 1]), time.perf_counter()
        try:
            for step in self._steps(belief, rng):
                if outcome.placements == 0:
                    outcome = replace(outcome, plan_seconds=time.perf_counter() - start)
                if outcome.first_touches == 0 and len(step.after.contacts) >= 3:
                    outcome = self._after_first(outcome, step)
                elif outcome.first_touches == outcome.touches and not outcome.labels:
                    outcome = replace(outcome, labels_soon=self._labels_right(step.after))
                outcome = self._ended(outcome, step)
        except NoPlan as error:
            outcome = replace(outcome, why=str(error))
        return outcome

    def _steps(self, belief: Belief, rng: np.random.Generator) -> Iterator[Step]:
        """The placements; the oracle makes but one."""
        options = PlannerOptions(criterion=ARMS[self.job.arm], certify=False)
        hand = _hand(self.job.hand)
        if self.job.arm == "oracle":
            plan = plan_preferred(
                hand, _right(belief, self.surface), self.told, (3, 2, 1), goal=GOAL, rng=rng,
                options=replace(options, placements=ORACLE_PLACEMENTS),
                prefer=self._knowing(belief, hand.fingers[0].pad_radius),
            )  # fmt: skip
            felt = tuple(self._touch(probe) for probe in plan.probes)
            yield Step(plan, felt, belief, update(belief, felt), len(felt))
            return
        yield from explore(
            hand, self._touch, belief, self.told,
            goal=GOAL, budget=self.job.budget, rng=rng, options=options,
        )  # fmt: skip

    def _knowing(self, before: Belief, pad: float) -> Preference:
        """Candidates by the error they leave on the true object, from what was known before; an
        untold offset of the sensor is known, too."""
        surface = self.surface
        z = np.linspace(*surface.profile.z_range, _NODES)
        radii = surface.profile.derivatives(z)[0][None]
        truth = SampledObjects(surface.axis.point[None], surface.axis.direction[None], z, radii)
        untold = OFFSET if self.job.setting == "offset" else 0.0
        worth = Worth(before, truth, self.told, GOAL, untold=untold, pad=pad)

        def prefer(candidates: Candidates, ranking: Ranking) -> Index:
            after = worth.covariances(worth.landed(surface.at(candidates.theta, candidates.z)))[0]
            error = np.trace(after, axis1=1, axis2=2)
            return np.asarray(ranking.order[np.argsort(error[ranking.order])])

        return prefer

    def _touch(self, probe: Probe) -> Contact | Miss:
        felt = self.world.touch(probe.approach)
        return felt if isinstance(felt, Miss) else replace(felt, noise=self.told)

    def _after_first(self, outcome: Outcome, step: Step) -> Outcome:
        angle, offset = self._errors(step.after)
        second = self._second(step.after) if self.job.arm != "oracle" else (np.nan, np.nan)
        right = self._labels_right(step.after)
        return replace(
            outcome, first_touches=step.touches, first_deg=angle, first_mm=offset,
            labels=right, labels_soon=right, margin=self._margin(),
            second_deg=second[0], second_mm=second[1],
        )  # fmt: skip

    def _second(self, belief: Belief) -> tuple[float, float]:
        """Errors after one more placement, felt by the same sensor in a session of its own."""
        options = PlannerOptions(criterion=ARMS[self.job.arm], certify=False, margin=0.0)
        rng = np.random.default_rng([self.job.seed, 2])
        hand = _hand(self.job.hand)
        aside = replace(self, world=World(self.surface, self.session, rng=rng, hand=hand))
        with suppress(NoPlan):
            plan = plan_probes(hand, belief, self.told, goal=GOAL, rng=rng, options=options)
            return self._errors(update(belief, [aside._touch(probe) for probe in plan.probes]))
        return np.nan, np.nan

    def _errors(self, belief: Belief) -> tuple[float, float]:
        """Direction [deg], and offset at the object's middle [mm]."""
        surface = self.surface
        middle = surface.axis.point + np.mean(surface.profile.z_range) * surface.axis.direction
        return (
            float(np.rad2deg(angle_between(belief.axis, surface.axis))),
            1e3 * offset_at(belief.axis, surface.axis, middle),
        )

    def _ended(self, outcome: Outcome, step: Step) -> Outcome:
        after = step.after
        angle, offset = self._errors(after)
        verdict = after.estimate.verdict if after.estimate else "undetermined"
        error = to_chart(after.axis, self.surface.axis)
        with suppress(np.linalg.LinAlgError):
            far = float(error @ np.linalg.solve(after.covariance, error)) > FOUR_SIGMA
        met = GOAL.met_by(after)
        twice = angle > np.rad2deg(2.0 * GOAL.angle) or offset > 2e3 * GOAL.offset
        return replace(
            outcome, touches=step.touches, placements=outcome.placements + 1, met=met,
            verdict=verdict,
            wrong=verdict == "determined" and (far or (met and twice)),
            why="" if met else GOAL.missing(after),
        )  # fmt: skip

    def _labels_right(self, belief: Belief) -> bool:
        """Whether every row taken for the parallel's is the one nearer to the true parallel."""
        felt = [r for r in self.world.records if r.truth is not None]
        if belief.estimate is None or len(felt) < 3:
            return False
        rows = belief.estimate.best.parallel_rows
        return all(label_right(r, row) for r, row in zip(felt, rows, strict=False))

    def _margin(self) -> float:
        felt = [r.truth.p for r in self.world.records if r.truth is not None]
        if len(felt) < 3:
            return np.nan
        theta, _, z = self.surface.cylindrical(np.array(felt[:3]))
        z = np.clip(z, *self.surface.profile.z_range)
        triples = placed_triples(self.surface.profile, theta[None], z[None])
        return float(margins(triples).values.min())


def label_right(record: TouchRecord, row_0: float) -> bool:
    """Whether the row believed to be the parallel's is the one nearer to the true parallel.

    A flat end or an umbilic has no directions, so nothing there can be taken wrongly.
    """
    assert isinstance(record.outcome, Contact)
    assert record.truth is not None
    if record.outcome.umbilicity < UMBILIC:
        return True
    nearer = int(np.argmax(np.abs(record.outcome.directions @ record.truth.k_theta)))
    return bool((row_0 > 0.5) == (nearer == 0))


def _right(belief: Belief, surface: SurfaceOfRevolution) -> Belief:
    """What somebody believes who knows the object: exactly its pose and profile."""
    low, high = surface.profile.z_range
    z = np.linspace(low, high, _NODES)
    r = surface.profile.derivatives(z)[0]
    band = ProfileBand(frozen(z), frozen(r), frozen(1e-10 * np.eye(_NODES)))
    sharp = frozen(np.diag([1e-5, 1e-5, 1e-4, 1e-4]) ** 2)
    only = replace(belief.hypotheses[0], axis=surface.axis, covariance=sharp)
    prior = replace(belief.prior, axis=surface.axis, covariance=sharp)
    return replace(belief, prior=prior, prior_band=band, hypotheses=(only,), band=band)
