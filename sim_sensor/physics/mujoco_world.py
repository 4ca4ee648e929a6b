"""The world again, in MuJoCo: geometry, contact and what a pad feels are a physics engine's.

The same door as `sim_sensor.world`: a touch goes in, a contact or a miss comes out. The hand
carries out the planned approach with position actuators, stops when its pad is pressed with the
approach's force, reads the pad's image and goes back the way it came. Only the reader is ours.

Conventions
    The base is where the plan puts it: the arm is ideal. Motions between touches are carried out
    (`follow`), or else the hand is set to the start of the next approach; the object stays where
    the last touch left it.
    A start that already presses the object is taken back along the approach's first step, the
    base with it, and the hand comes from there: `overlap` says how far.
    A pad that reaches the end of its path unpressed reports a miss where it really is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from estimator.axis import Axis
from estimator.contact import Contact, Miss
from estimator.readers.raw_sensors import RawSensor, raw_sensor, with_depth
from estimator.surface import Geometry, SurfaceOfRevolution
from estimator.vectors import Array, frozen
from hand_models.hand import Hand
from sim_sensor.physics.mujoco_follow import Followed, Timed, follow
from sim_sensor.physics.mujoco_hand import pad_name, place_base
from sim_sensor.physics.mujoco_models import OBJECT, Models, Standing, build_models
from sim_sensor.physics.mujoco_object import place_object
from sim_sensor.physics.mujoco_press import Press, Touching, press
from sim_sensor.physics.mujoco_skin import PITCH, feel, pixels
from sim_sensor.scanned import Scan, felt_at
from sim_sensor.signals.gel import GelPad, GelSession
from sim_sensor.signals.raw_sense import read_signal
from sim_sensor.solid import Solid
from sim_sensor.world import TouchRecord

SENSOR = "gel-depth"
_REST = 0.5  # after a push [s]


@dataclass(frozen=True, eq=False)
class MujocoRecord(TouchRecord):
    """What happened in one touch, as MuJoCo has it; `truth` is the wall where the pad came to rest.

    Args:
        met: Where on the object the pad first met it, (3,); None after a miss.
        force: On the pad when it stopped [N].
        bumped: Links and other pads that met the object on the way, or its table.
        moved: How far this touch moved the object [m].
        reached: Whether the pad was pressed with the force asked for.
    """

    met: Array | None = None
    force: float = 0.0
    bumped: tuple[str, ...] = ()
    moved: float = 0.0
    reached: bool = False


class MujocoWorld:
    """A true object in MuJoCo, touched by a hand whose pads are domes of gel.

    Args:
        hand: That touches.
        surface: The object at its pose, its ends flat.
        standing: How it stands; held in place by default.
        models: Made before for this hand, profile and standing; the object is placed anew.
        noisy: Whether images have the errors of `gel-depth`; without, they are MuJoCo's own.
        rng: For the sensor.
    """

    def __init__(
        self,
        hand: Hand,
        surface: SurfaceOfRevolution,
        *,
        rng: np.random.Generator,
        standing: Standing | None = None,
        models: Models | None = None,
        noisy: bool = True,
    ) -> None:
        self._hand, self._surface, self._rng = hand, surface, rng
        self._models = models or build_models(hand, surface, standing)
        for model in (self._models.moving, self._models.feeling):
            place_object(model, surface)
        self._data = mujoco.MjData(self._models.moving)
        self._felt = mujoco.MjData(self._models.feeling)
        self._pads = {f.name: _mounted(f.pad_radius, noisy, rng) for f in hand.fingers}
        self._noisy, self._solid = noisy, Solid(surface.profile)
        self._records: list[MujocoRecord] = []
        self._followed: list[Followed] = []
        mujoco.mj_forward(self._models.moving, self._data)

    @property
    def records(self) -> tuple[MujocoRecord, ...]:
        """What happened so far, in order."""
        return tuple(self._records)

    @property
    def sensor(self) -> RawSensor:
        """What the reader is told of the first finger's pad."""
        return next(iter(self._pads.values()))[0]

    @property
    def surface(self) -> SurfaceOfRevolution:
        """The true object where it is now."""
        return self._surface_in(self._data)

    def touch(self, path: Touching, *, finger_axis_W: Array | None = None) -> Contact | Miss:
        """Carry the approach out and feel.

        Args:
            finger_axis_W: Direction of the finger's last link, (3,): the image's x.
        """
        before = self._data.body(OBJECT).xpos.copy()
        pressed = press(self._models.moving, self._data, self._hand, path)
        record = self._record(path.finger, pressed, finger_axis_W)
        self._keep(record, before)
        return record.outcome

    def follow(self, way: Timed) -> Followed:
        """Carry a motion between touches out; what a finger feels of its end is one more record."""
        before = self._data.body(OBJECT).xpos.copy()
        told = follow(self._models.moving, self._data, self._hand, way)
        if told.press is not None:
            record = self._record(told.finger, told.press, None)
            if isinstance(record.outcome, Contact):
                self._keep(record, before)
                told = replace(told, contact=record.outcome)
        self._followed.append(told)
        return told

    def _keep(self, record: MujocoRecord, before: Array) -> None:
        """A record, with how far the object is from where it was before."""
        moved = float(np.linalg.norm(self._data.body(OBJECT).xpos - before))
        self._records.append(replace(record, moved=moved))

    @property
    def followed(self) -> tuple[Followed, ...]:
        """How motions between touches went, in order."""
        return tuple(self._followed)

    def push(self, force_W: Array, *, seconds: float) -> None:
        """Somebody bumps the object: a force [N] on its middle for a time; then it comes to rest.

        Raises:
            ValueError: The object is held.
        """
        model, data = self._models.moving, self._data
        body = data.body(OBJECT)
        if not model.body(OBJECT).jntnum[0]:
            raise ValueError("push: the object is held; let it stand")
        for k in range(int((seconds + _REST) / model.opt.timestep)):
            body.xfrc_applied[:3] = force_W if k * model.opt.timestep < seconds else 0.0
            mujoco.mj_step(model, data)

    def _record(self, finger: str, pressed: Press, axis: Array | None) -> MujocoRecord:
        told = MujocoRecord(
            Miss(pressed.tip, self._hand.finger(finger).pad_radius), pressed.tip, pressed.stop,
            overlap=pressed.overlap, met=pressed.met, force=pressed.force,
            bumped=pressed.bumped, reached=pressed.reached,
        )  # fmt: skip
        if pressed.rests is None:
            return told
        data = self._felt
        data.qpos[:] = pressed.qpos
        place_base(data, pressed.X_WB)
        mujoco.mj_forward(self._models.feeling, data)
        surface = self._surface_in(data)
        theta, rho, z = surface.cylindrical(pressed.tip)
        told = replace(
            told,
            truth=_geometry(surface, pressed.rests),
            part=self._solid.nearest(float(rho), float(z), float(theta)).part,
        )
        return self._feel(told, finger, np.zeros(3) if axis is None else axis)

    def _surface_in(self, data: mujoco.MjData) -> SurfaceOfRevolution:
        body = data.body(OBJECT)
        axis = Axis(frozen(body.xpos), frozen(body.xmat.reshape(3, 3)[:, 2]))
        return replace(self._surface, axis=axis)

    def _feel(self, told: MujocoRecord, finger: str, axis: Array) -> MujocoRecord:
        """With what the pad feels in the posed feeling model."""
        model, data, (sensor, session) = self._models.feeling, self._felt, self._pads[finger]
        image = feel(model, data, pad_name(finger), axis)
        if image is None:
            return told
        pad = data.geom(pad_name(finger))
        X_WG = np.eye(4)
        X_WG[:3, :3], X_WG[:3, 3] = pad.xmat.reshape(3, 3), pad.xpos
        X_WS = X_WG @ image.X_GS
        signal = image.depth
        if self._noisy:
            signal = session.image(1e3 * signal[None], rng=self._rng)[0]
            X_WS = X_WS @ np.linalg.inv(session.X_SM)
        felt = read_signal(sensor, signal, X_WS, self._rng if self._noisy else None)
        return replace(told, outcome=felt.contact or told.outcome, felt=felt)


def _mounted(radius: float, noisy: bool, rng: np.random.Generator) -> tuple[RawSensor, GelSession]:
    """What the reader is told of a pad, and the pad as it is."""
    sensor = with_depth(raw_sensor(SENSOR), pixel_pitch=PITCH, radius=radius)
    side = pixels(radius) * PITCH
    pad = GelPad(pitch=PITCH, size=(side, side), radius=radius)
    return sensor, pad.session(rng=rng) if noisy else pad.ideal()


def _geometry(surface: SurfaceOfRevolution, point_W: Array) -> Geometry:
    """Of the wall beside a point."""
    place = surface.place_of(point_W)
    if isinstance(surface.profile, Scan):
        return felt_at(surface, surface.profile, place.theta, place.z)
    return surface.at(np.array(place.theta), np.array(place.z))
