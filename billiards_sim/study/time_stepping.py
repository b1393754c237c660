# SPDX-License-Identifier: Apache-2.0
"""The paper's time stepping, literal and corrected, beside the engine: three solvers with one interface.

`SOLVERS` makes a solver from a scene and a time step:

- `event`: the engine. Exact; the time step is not used.
- `time_step`: the paper's scheme with friction, the step to a collision and the clock corrected. First order.
- `paper`: the scheme of sections 2.2 to 2.4 as the paper's program computes it. It does not converge.

The scheme: move all balls by one time step, friction constant (equations 13 to 27). Look for balls and rails that
overlap then (28 to 31), estimate on straight lines when each pair met (32 to 42), go back, move all balls to the
earliest of these times instead, and let that one pair collide (43 to 49).

What is wrong in the paper; "mistake 3" in a comment below is the third of these:

| | mistake | `paper` | `time_step` |
|---|---|---|---|
| 1 | balls count as rolling while they slip | kept | corrected |
| 2 | rolling friction acts against the slip, so it never brings a ball to rest | kept | corrected |
| 3 | the step to a collision has the ball touch the cloth with its top | kept | corrected |
| 4 | the printed moment of inertia is 1000 times too large | right in its program | right |
| 5 | collisions are looked for at the end of a step only | kept | kept |
| 6 | collisions may follow each other without end, or lie in the past | kept | none in the past |
| 7 | the cue's offset is right along +x only | the engine's cue | the engine's cue |
| 8 | random balls start inside each other and the rails | refused by `Scene` | refused by `Scene` |
| 9 | the first step is not counted | kept | corrected |

Where 5 or 6 leave the scheme without a next step, both end in a `SchemeError`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields, replace
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from billiards_sim.engine.events import Event
from billiards_sim.engine.features import RAILS
from billiards_sim.engine.scene import Scene
from billiards_sim.engine.simulation import Simulation, comes_to_rest

Array = NDArray[np.float64]

TIME_STEP = 0.01
"""s. The default; a ball at 5 m/s moves nearly its diameter in one."""

LONGEST_STEP = 1.0
"""s. In one of these a shot is half over; where numbers overflow is far beyond."""

ROLLING_MARGIN = 0.01
"""m/s. Mistake 1: in the paper a ball rolls once |slip| - R|w| is less (equation 27)."""

NO_CONTACT = 100.0
"""s. What the paper's program takes for a contact that does not come."""

MODELLED = {
    *("mass", "radius", "gravity", "sliding_friction", "rolling_friction", "rail_restitution"),
    *("length", "width", "rail_thickness"),
    *("cue_contact_time", "cue_end_mass", "miscue_limit"),  # shots are the engine's
    *("ball_friction_decay", "poisson_ratio"),  # of a friction that is 0, and of rigid balls
}
"""Fields of physics and table that the stepped solvers know; the others must be as they are for the paper."""

STALLED_CONTACTS = 1000
"""Contacts after which the clock must be half a time step further; a break at 8 m/s has some tens in all."""


class SchemeError(RuntimeError):
    """The scheme cannot go on: its steps lead nowhere, or back by more than a step, or to no real number.

    The text names the time, the balls and the figure. The solver stays where it got to.
    """


class Solver(Protocol):
    """What the three solvers share; a `Simulation` has it all. SI units, frame `table`, N balls, arrays are copies."""

    @property
    def start_scene(self) -> Scene:
        """Where it started from; its `names` are the balls, in the order of the arrays."""

    @property
    def time(self) -> float:
        """s, by the solver's own clock."""

    @property
    def positions(self) -> Array:
        """(N, 2) m."""

    @property
    def velocities(self) -> Array:
        """(N, 2) m/s."""

    @property
    def angular_velocities(self) -> Array:
        """(N, 3) rad/s."""

    @property
    def kinetic_energy(self) -> float:
        """Of all balls, linear and rotational, J."""

    @property
    def at_rest(self) -> bool:
        """Whether no ball moves, spin about the vertical aside."""

    def strike(self, force: Sequence[float], offset: Sequence[float] = (0.0, 0.0), ball: str = "cue") -> None:
        """Hit a resting ball with the cue, as `Simulation.strike` does."""

    def run(self, until: float | None = None) -> Sequence[Event]:
        """Go on until a time, s, or until every ball rests; returns the events.

        `event` and `time_step` stop at the time to the bit, `paper` up to one of its steps later: look at `time`.
        """


class Balls(NamedTuple):
    """State of all balls."""

    positions: Array  # (N, 2) m
    velocities: Array  # (N, 2) m/s
    spins: Array  # (N, 3) rad/s


class Contact(NamedTuple):
    """The contact that ends a step."""

    time: float  # s from the start of the step
    ball: int = -1
    other: int | None = None  # the other ball, None for a rail
    axis: int = 0  # of a rail: 0 for x, 1 for y
    side: int = 0  # of a rail: 0 for low, 1 for high


class SteppedSolver(ABC):
    """The scheme without friction, which the subclasses add.

    Args:
        scene: where everything starts. A shot of the scene is not played by itself: `strike` plays one.
        time_step: s.

    Raises:
        ValueError: `time_step` is not > 0 or above `LONGEST_STEP`; a ball is not in play; physics or table have an
            effect that the paper does not.

    Its events are shots and collisions; ends of slip and of motion are not among them.
    """

    def __init__(self, scene: Scene, time_step: float = TIME_STEP) -> None:
        if not 0.0 < time_step <= LONGEST_STEP:
            raise ValueError(f"time_step must be a number > 0, <= {LONGEST_STEP:g} (s), got {time_step!r}")
        if not scene.in_play.all():
            off = scene.names[int(np.argmin(scene.in_play))]
            raise ValueError(f"the stepped solvers take scenes with every ball in play; ball {off!r} is not")
        _check_effects(scene)
        self._scene = scene
        self._time_step = time_step
        self._time = 0.0
        self._overshoot = 0.0  # s, by how much the clock may pass the time asked for
        self._balls = Balls(scene.positions.copy(), scene.velocities.copy(), scene.angular_velocities.copy())
        self._start: Simulation | None = Simulation(scene)  # takes shots; None once under way
        self._events: list[Event] = []  # not handed over yet
        self._mark = -math.inf  # s, the clock when it had last gone on by half a step
        self._contacts_since_mark = 0
        table = scene.table
        self._bounds = np.array([[table.x_min, table.y_min], [table.x_max, table.y_max]])

    @property
    def start_scene(self) -> Scene:
        return self._scene

    @property
    def time(self) -> float:
        return self._time

    @property
    def positions(self) -> Array:
        return self._balls.positions.copy()

    @property
    def velocities(self) -> Array:
        return self._balls.velocities.copy()

    @property
    def angular_velocities(self) -> Array:
        return self._balls.spins.copy()

    @property
    def kinetic_energy(self) -> float:
        return self._scene.physics.kinetic_energy(self._balls.velocities, self._balls.spins)

    @property
    def at_rest(self) -> bool:
        return not (self._balls.velocities.any() or self._balls.spins[:, :2].any())

    def strike(self, force: Sequence[float], offset: Sequence[float] = (0.0, 0.0), ball: str = "cue") -> None:
        """Hit a resting ball with the engine's cue, before the first step only.

        Raises:
            ValueError: the run is under way, or the engine refuses the shot.
        """
        if self._start is None:
            raise ValueError(f"a shot must come before the first step, the clock is at {self._time:.9g} s")
        self._start.strike(force, offset, ball)
        index = self._scene.names.index(ball)
        self._balls.positions[index] = self._start.positions[index]
        self._balls.velocities[index] = self._start.velocities[index]
        self._balls.spins[index] = self._start.angular_velocities[index]
        shots = [event for event in self._start.copy().advance(0.0) if event.kind == "shot"]
        self._events.append(replace(shots[-1], time=self._time))

    def run(self, until: float | None = None) -> Sequence[Event]:
        """Go on until a time, s, or until every ball rests; returns the shots and collisions.

        Raises:
            ValueError: `until` is not finite or has passed; or, without it, the balls never rest.
            SchemeError: the scheme cannot go on.
        """
        for _ in self.steps(until):
            pass
        events, self._events = self._events, []
        return events

    def steps(self, until: float | None = None) -> Iterator[None]:
        """Go on as `run` does, with a stop after each step for a look at the state; the next `run` returns the events.

        Raises:
            ValueError, SchemeError: as `run`.
        """
        if until is None:
            self._check_it_ends()
            while not self.at_rest:
                self._step(self._time_step)
                yield
        else:
            if not (math.isfinite(until) and until >= self._time - self._overshoot):
                raise ValueError(f"until must be a finite time >= now, {self._time:.9g} s, got {until!r}")
            yield from self._steps_until(until)

    @abstractmethod
    def _steps_until(self, until: float) -> Iterator[None]: ...

    @abstractmethod
    def _check_it_ends(self) -> None:
        """Raise `ValueError` if the balls never rest."""

    @abstractmethod
    def _moved(self, balls: Balls, duration: float) -> Balls:
        """All balls one step further (section 2.2)."""

    @abstractmethod
    def _moved_to_contact(self, balls: Balls, duration: float) -> Balls:
        """All balls further to the contact that ends the step (section 2.4)."""

    def _step(self, duration: float) -> None:
        self._start = None
        after = self._moved(self._balls, duration)
        contact = self._first_contact(after, duration)
        if contact is None:
            self._balls = after
            self._time += duration
            return
        self._balls, event = self._collided(self._moved_to_contact(self._balls, contact.time), contact)
        self._time += contact.time
        self._events.append(event)
        self._check_progress(event)

    def _first_contact(self, after: Balls, duration: float) -> Contact | None:
        """The earliest contact of the balls and rails that overlap after a step (section 2.3).

        Mistake 5: what overlaps within the step only is missed, and straight lines replace the balls' paths.
        """
        radius = self._scene.physics.radius
        away = after.positions[:, np.newaxis] - after.positions
        overlapping = np.triu((away * away).sum(axis=2) <= 4.0 * radius**2, k=1)  # equations 28, 29
        beyond = np.array([after.positions - radius <= self._bounds[0], after.positions + radius >= self._bounds[1]])
        earliest = Contact(duration + 1.0)
        for ball in np.flatnonzero(overlapping.any(axis=1) | beyond.any(axis=(0, 2))).tolist():
            for other in np.flatnonzero(overlapping[ball]).tolist():
                time = self._pair_contact_time(ball, other)
                if 0.0 < time < earliest.time:
                    earliest = Contact(time, ball, other)
            times = [NO_CONTACT, NO_CONTACT]
            for side in (0, 1):
                for axis in np.flatnonzero(beyond[side, ball]).tolist():
                    times[axis] = self._rail_contact_time(ball, axis, side)
                axis = 0 if times[0] < times[1] else 1
                if beyond[side, ball].any() and times[axis] < earliest.time:
                    earliest = Contact(times[axis], ball, None, axis, side)
        if earliest.time > duration:
            return None
        self._check_contact_time(earliest)
        return earliest

    def _pair_contact_time(self, ball: int, other: int) -> float:
        """s until two balls meet on straight lines, the smaller root that is not negative (equations 36 to 40)."""
        a, b, discriminant = self._quadratic(ball, other)
        root = math.sqrt(max(discriminant, 0.0))  # complex roots are compared by their real parts
        with np.errstate(divide="ignore", invalid="ignore"):  # without relative motion 0/0, which is no contact
            times = [float((-b + sign_root) / (2.0 * a)) for sign_root in (root, -root)]
        late, early = (NO_CONTACT if time < 0.0 else time for time in times)
        return late if late < early else early

    def _quadratic(self, ball: int, other: int) -> tuple[np.float64, np.float64, np.float64]:
        """Coefficients a and b of a t^2 + b t + c = 0, and its discriminant (equations 36 to 39)."""
        position = self._balls.positions[ball] - self._balls.positions[other]
        velocity = self._balls.velocities[ball] - self._balls.velocities[other]
        a = _dot(velocity, velocity)
        b = 2.0 * _dot(position, velocity)
        c = _dot(position, position) - 4.0 * self._scene.physics.radius**2
        return a, b, b * b - 4.0 * a * c

    def _rail_contact_time(self, ball: int, axis: int, side: int) -> float:
        """s until a ball meets a rail on a straight line (equation 42); mistake 6: in the past if it is beyond."""
        radius = self._scene.physics.radius
        edge = self._bounds[side, axis] + (radius if side == 0 else -radius)
        with np.errstate(divide="ignore", invalid="ignore"):
            return float((edge - self._balls.positions[ball, axis]) / self._balls.velocities[ball, axis])

    def _check_contact_time(self, contact: Contact) -> None:
        name = self._scene.names[contact.ball]
        if contact.other is None:
            if contact.time < -self._time_step:
                raise SchemeError(
                    f"at {self._time:.9g} s: ball {name!r} at {self._balls.positions[contact.ball].tolist()} m moves "
                    f"across rail {RAILS[2 * contact.axis + contact.side]} at "
                    f"{self._balls.velocities[contact.ball, contact.axis]:.6g} m/s, which puts their contact at "
                    f"{contact.time:.6g} s from there"
                )
            return
        a, _, discriminant = self._quadratic(contact.ball, contact.other)
        if discriminant < 0.0:
            diameter = 2.0 * self._scene.physics.radius
            gap = math.sqrt(diameter**2 - 0.25 * discriminant / a) - diameter
            raise SchemeError(
                f"at {self._time:.9g} s: balls {name!r} and {self._scene.names[contact.other]!r} overlap after the "
                f"step, but on straight lines they pass each other {gap:.6g} m apart: no real time of contact"
            )

    def _collided(self, balls: Balls, contact: Contact) -> tuple[Balls, Event]:
        if contact.other is None:
            return self._rail_collision(balls, contact)
        return self._ball_collision(balls, contact, contact.other)

    def _ball_collision(self, balls: Balls, contact: Contact, other: int) -> tuple[Balls, Event]:
        """The velocities along the line of centres change places (equations 43 to 49)."""
        names, ball = self._scene.names, contact.ball
        away = balls.positions[ball] - balls.positions[other]
        distance = math.sqrt(_dot(away, away))
        if distance == 0.0:
            raise SchemeError(
                f"at {self._time:.9g} s: division by zero: the centres of balls {names[ball]!r} and {names[other]!r} "
                f"are both at {balls.positions[ball].tolist()} m"
            )
        normal = away / distance
        first, second = balls.velocities[ball], balls.velocities[other]
        along_first = _dot(first, -normal) * -normal
        along_second = _dot(second, normal) * normal
        velocities = balls.velocities.copy()
        velocities[ball] = first - along_first + along_second
        velocities[other] = second - along_second + along_first
        approach = float(_dot(second - first, normal))
        middle = 0.5 * (balls.positions[ball] + balls.positions[other])
        event = Event(
            time=self._time + contact.time,
            kind="ball_ball",
            balls=(names[ball], names[other]),
            rail=None,
            point=(float(middle[0]), float(middle[1])),
            normal=(float(normal[0]), float(normal[1])),
            approach_speed=approach,
            impulse=self._scene.physics.mass * approach,
        )
        return balls._replace(velocities=velocities), event

    def _rail_collision(self, balls: Balls, contact: Contact) -> tuple[Balls, Event]:
        """The velocity across the rail turns round and is multiplied by the restitution (section 2.4)."""
        physics, ball, axis, side = self._scene.physics, contact.ball, contact.axis, contact.side
        velocities = balls.velocities.copy()
        velocities[ball, axis] *= -physics.rail_restitution
        into_table = 1.0 if side == 0 else -1.0
        approach = -into_table * float(balls.velocities[ball, axis])
        point = balls.positions[ball].tolist()
        point[axis] = float(self._bounds[side, axis])
        event = Event(
            time=self._time + contact.time,
            kind="ball_rail",
            balls=(self._scene.names[ball],),
            rail=RAILS[2 * axis + side],
            point=(point[0], point[1]),
            normal=(into_table, 0.0) if axis == 0 else (0.0, into_table),
            approach_speed=approach,
            impulse=physics.mass * (1.0 + physics.rail_restitution) * approach,
        )
        return balls._replace(velocities=velocities), event

    def _check_progress(self, event: Event) -> None:
        # Mistake 6: nothing else ends ever smaller steps.
        if self._time - self._mark >= 0.5 * self._time_step:
            self._mark = self._time
            self._contacts_since_mark = 0
        self._contacts_since_mark += 1
        if self._contacts_since_mark > STALLED_CONTACTS:
            with_what = f"rail {event.rail}" if event.rail else f"ball {event.balls[1]!r}"
            raise SchemeError(
                f"at {self._time:.9g} s: stalled: {STALLED_CONTACTS} contacts, the last of ball {event.balls[0]!r} "
                f"with {with_what}, took the clock on by {self._time - self._mark:.6g} s"
            )


class PaperSolver(SteppedSolver):
    """The paper's scheme as its program has it, mistakes included.

    Its clock reads one step less than the time that has passed (mistake 9), so it starts at `-time_step`. It stops
    after the step in which the clock gets to the time asked for, up to one step late: `time` says where it is. A time
    that has passed by less than a step needs none. Its balls never rest, so `run` needs a time.
    """

    def __init__(self, scene: Scene, time_step: float = TIME_STEP) -> None:
        super().__init__(scene, time_step)
        self._time = -time_step
        self._overshoot = time_step

    def _steps_until(self, until: float) -> Iterator[None]:
        while self._time < until:
            self._step(self._time_step)
            yield

    def _check_it_ends(self) -> None:
        raise ValueError("the balls of the paper's scheme never rest: give run() a time `until`")

    def _step(self, duration: float) -> None:
        first = self._start is not None
        super()._step(duration)
        if first:
            self._time = 0.0  # mistake 9, also where the first step ends early at a collision

    def _moved(self, balls: Balls, duration: float) -> Balls:
        radius = self._scene.physics.radius
        slip = _slip(balls, -radius)
        rolling = _size(slip) - radius * _size(balls.spins) < ROLLING_MARGIN  # mistake 1
        return self._pushed(balls, duration, -radius, rolling)

    def _moved_to_contact(self, balls: Balls, duration: float) -> Balls:
        radius = self._scene.physics.radius
        rolling = _size(balls.velocities) <= radius * _size(balls.spins)  # mistake 1, in another form
        return self._pushed(balls, duration, radius, rolling)  # mistake 3: the lever should be -radius

    def _pushed(self, balls: Balls, duration: float, lever: float, rolling: NDArray[np.bool_]) -> Balls:
        """One step of constant friction against the slip (equations 13 to 23), rolling or not: mistake 2."""
        physics = self._scene.physics
        slip = _slip(balls, lever)
        speed = _size(slip)[:, np.newaxis]
        coefficient = np.where(rolling, physics.rolling_friction, physics.sliding_friction)[:, np.newaxis]
        strength = -coefficient * physics.mass * physics.gravity
        friction = np.divide(strength, speed, out=np.zeros_like(speed), where=speed != 0.0) * slip
        acceleration = friction / physics.mass
        torque = lever * np.column_stack((-friction[:, 1], friction[:, 0]))
        spins = balls.spins.copy()
        spins[:, :2] += torque / physics.moment_of_inertia * duration
        return Balls(
            balls.positions + balls.velocities * duration + 0.5 * acceleration * duration**2,
            balls.velocities + acceleration * duration,
            spins,
        )


class TimeStepSolver(SteppedSolver):
    """The paper's scheme with friction, the step to a collision and the clock corrected.

    A ball rolls through a step in which sliding friction can end its slip, and rests when rolling friction can stop
    it within the step. `run(until)` shortens its last step to end at that time.
    """

    def _steps_until(self, until: float) -> Iterator[None]:
        while self._time < until:
            self._step(min(self._time_step, until - self._time))
            yield
        self._time = until

    def _check_it_ends(self) -> None:
        physics = self._scene.physics
        if not (self.at_rest or comes_to_rest(physics)):
            raise ValueError(
                f"the balls never rest with sliding_friction {physics.sliding_friction:g} and rolling_friction "
                f"{physics.rolling_friction:g}: give run() a time `until`"
            )

    def _moved(self, balls: Balls, duration: float) -> Balls:
        """Constant friction over a step, in its right direction.

        Sliding friction takes dv = mu_s g dt from the velocity and 7/2 dv from the slip. Where the slip is less, all of
        it goes, 2/7 of it from the velocity; then rolling friction acts along the motion and the spin is v/R.
        """
        physics = self._scene.physics
        slip = _slip(balls, -physics.radius)
        speed = _size(slip)[:, np.newaxis]
        change = physics.sliding_friction * physics.gravity * duration
        sliding = speed > 3.5 * change
        share = np.divide(change, speed, out=np.full_like(speed, 2.0 / 7.0), where=sliding)
        velocities = balls.velocities - share * slip
        spins = balls.spins.copy()
        spins[:, :2] += 2.5 / physics.radius * share * np.column_stack((-slip[:, 1], slip[:, 0]))
        rolling = ~sliding[:, 0]
        rolled = self._rolled(velocities[rolling], duration)
        velocities[rolling] = rolled
        spins[rolling, :2] = np.column_stack((-rolled[:, 1], rolled[:, 0])) / physics.radius
        return Balls(balls.positions + 0.5 * (balls.velocities + velocities) * duration, velocities, spins)

    def _moved_to_contact(self, balls: Balls, duration: float) -> Balls:
        return self._moved(balls, duration)

    def _rail_contact_time(self, ball: int, axis: int, side: int) -> float:
        """As in the scheme, but never in the past: at once if the ball moves into the rail, else not in this step."""
        time = super()._rail_contact_time(ball, axis, side)
        if time < 0.0:
            velocity = self._balls.velocities[ball, axis]
            return 0.0 if (velocity < 0.0 if side == 0 else velocity > 0.0) else math.inf
        return time

    def _rolled(self, velocities: Array, duration: float) -> Array:
        change = self._scene.physics.rolling_friction * self._scene.physics.gravity * duration
        speed = _size(velocities)[:, np.newaxis]
        left = np.divide(speed - change, speed, out=np.zeros_like(speed), where=speed > change)
        return velocities * left


def _check_effects(scene: Scene) -> None:
    for owner in (scene.physics, scene.table):
        for field in fields(owner):
            value = getattr(owner, field.name)
            if field.name not in MODELLED and value != field.default:
                raise ValueError(
                    f"the stepped solvers have the paper's model: {type(owner).__name__.lower()}.{field.name} must be "
                    f"{field.default!r}, got {value!r}"
                )


def _slip(balls: Balls, lever: float) -> Array:
    """(N, 2) m/s: v + w x (0, 0, lever), with the lever -R that of the contact with the cloth (equations 13, 14)."""
    return balls.velocities + lever * np.column_stack((balls.spins[:, 1], -balls.spins[:, 0]))


def _size(vectors: Array) -> Array:
    """(N,) lengths of (N, k) vectors."""
    lengths: Array = np.sqrt((vectors * vectors).sum(axis=1))
    return lengths


def _dot(one: Array, other: Array) -> np.float64:
    # Two products and a sum, which round alike on every machine; a library's dot product may fuse them.
    product: np.float64 = one[0] * other[0] + one[1] * other[1]
    return product


SOLVERS: dict[str, Callable[[Scene, float], Solver]] = {
    "event": lambda scene, time_step: Simulation(scene),
    "time_step": TimeStepSolver,
    "paper": PaperSolver,
}
"""Solver by name, made from a scene and a time step in s."""
