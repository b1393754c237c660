# SPDX-License-Identifier: Apache-2.0
"""Exact reference scenes for billiards, solved event by event in multiprecision arithmetic.

Independent of the engine it is meant to check: no shared code, only the same physical model. A ball slides (constant
deceleration against its contact slip, which keeps its direction), rolls (constant deceleration against its velocity)
or rests; balls collide elastically and without friction; a rail reverses the normal velocity times its restitution.
Between events every position is therefore a parabola, and every contact the root of a polynomial of degree 4 (two
balls) or 2 (ball and rail). Each root is found twice, by isolation between the roots of the derivative and by
`mpmath.polyroots`, and the two must agree.

    make_exact_scenes.py OUT.json                 solve the scenes below and write them
    make_exact_scenes.py --verify FILE.json       solve a file's scenes again and print the largest differences
    make_exact_scenes.py --truth OUT.json         solve the scenes that `benchmark` measures errors against, and write
                                                  what it needs of them: billiards_sim/study/truth.json
"""

from __future__ import annotations

import argparse
import json
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import mpmath as mp
from mpmath import mpf

DIGITS = 50  # of the reference solutions
PERTURBED_DIGITS = 30  # of the perturbed ones, which need to resolve 1e-12 m only
PERTURBATION = "1e-12"  # m, m/s and rad/s: added to or taken from every initial value of a moving ball
PERTURBED_RUNS = 10
SMALLEST_GAP = "1e-6"  # s: events closer than this have no order that a float64 solver must reproduce
MOST_EVENTS = 300  # a scene that has more bounces infinitely often in a finite time: out of scope here
SNAPSHOTS = ("0.5", "1.0", "2.0", "3.0", "5.0")
FINAL_TIME = "5"
TRUTH_DIGITS = (60, 90)  # the benchmark's scenes are solved with both, because a break magnifies errors
TRUTH_AGREEMENT = "1e-20"  # m, between these two solutions: what is written is right to its last digit
TRUTH_TIMES = ("0.5", "1", "2", "5")  # s
DEFAULT_CONSTANTS: dict[str, Any] = {
    "R": "0.028575",
    "m": "0.16",
    "g": "9.81",
    "mu_slide": "0.2",
    "mu_roll": "0.01",
    "rail_restitution": "0.7",
    "inner_bounds": {"x": ["0.0508", "2.3908"], "y": ["0.0508", "1.2208"]},
    "note": "ball centre reaches a rail at bound -/+ R",
}
MODEL = """\
u = v + w x (0, 0, -R) = (vx - R wy, vy + R wx)   slip of the contact point
slide (u != 0): a = -mu_slide g u/|u|, R dw/dt = (5/2) mu_slide g (-uy, ux)/|u|, wz constant, until u = 0
roll  (u == 0): a = -mu_roll g v/|v|, w = (-vy, vx)/R, until v = 0
ball-ball: equal masses, frictionless, elastic: normal velocities swap.   rail: vn -> -e vn.   Spin is untouched.
"""

Vector = tuple[mpf, mpf]
Number = Callable[[str], mpf]


@dataclass(frozen=True)
class SceneSpec:
    """A scene to solve; every number an exact decimal.

    Attributes:
        balls: one string a ball, "x y", "x y  vx vy" or "x y  vx vy  wx wy wz" in m, m/s and rad/s.
        constants: what differs from `DEFAULT_CONSTANTS`.
        snapshots: s, ascending.
    """

    name: str
    description: str
    balls: tuple[str, ...]
    constants: dict[str, Any] = field(default_factory=dict)
    snapshots: tuple[str, ...] = SNAPSHOTS
    final_time: str = FINAL_TIME

    def initial(self) -> list[list[str]]:
        """Return seven decimals a ball: position, velocity and angular velocity."""
        return [(ball.split() + ["0"] * 5)[:7] for ball in self.balls]


SCENES = (
    SceneSpec(
        "three_rail_bank",
        "three rails with side spin, then an object ball",
        ("0.5 0.35  2.6 2.2  -60 40 45", "1.332 0.108"),
    ),
    SceneSpec(
        "rail_topspin",
        "topspin holds the ball at a rail for seven bounces; it rolls away before they accumulate",
        ("2.35 0.4  0.3 0.9  -12 140 0",),
    ),
    SceneSpec(
        "four_random",
        "four random balls at 2 to 4 m/s with spin",
        (
            "0.6235 0.6823  0.248 2.507  59.5 -3.6 40.4",
            "0.9139 0.7462  -1.895 -2.264  -41.9 16.2 44.2",
            "1.4766 0.1701  -0.167 -3.042  20.6 -52.3 31",
            "0.129 0.9961  -1.007 3.019  -56.3 43.9 -3.3",
        ),
    ),
    SceneSpec(
        "four_random_sensitive",
        "four random balls at 2 to 4 m/s with spin; two collisions magnify every error some thousand times",
        (
            "2.0924 0.8343  1.526 2.751  -10.6 59.3 -47.6",
            "1.7863 1.0679  2.509 -0.815  -6.1 -35 -22",
            "0.6716 0.7802  -1.955 3.279  -8.7 15.3 36.7",
            "2.0909 1.0332  2.602 1.462  8.8 -55.8 -48.7",
        ),
    ),
    SceneSpec(
        "six_balls",
        "three random balls among three at rest",
        (
            "1.1441 0.8035  -2.13 0.842  -40.5 48.7 -52.9",
            "1.5661 0.2526  3.245 1.643  22.4 -19.6 -11.4",
            "0.1239 0.501  3.66 0.43  -52.7 49.8 1.1",
            "0.7029 0.9671",
            "1.6193 0.7436",
            "1.328 0.8076",
        ),
    ),
    SceneSpec(
        "six_balls_sensitive",
        "three random balls among three at rest; a thin hit magnifies every error some thousand times",
        (
            "0.6235 0.6823  -3.632 0.544  16.7 -41.9 16.2",
            "0.9139 0.7462  -3.697 -0.542  29 20.6 -52.3",
            "1.4766 0.1701  -2.956 -1.905  -23.8 -56.3 43.9",
            "0.129 0.9961",
            "0.6706 0.3507",
            "2.2904 0.6032",
        ),
    ),
    SceneSpec("thin_cut", "a cut 0.05 mm short of a miss", ("0.6 0.5  2.5 0", "1.2 0.5571")),
    SceneSpec(
        "draw_into_rail",
        "heavy backspin: the cue ball draws back from the object ball to the far rail",
        ("1.4 0.63  3.5 0.1  5 -150 0", "1.8 0.65"),
    ),
    SceneSpec(
        "very_slow",
        "1 mm/s: balls a micrometre apart, and one a micrometre from a rail",
        ("1 0.6  0.001 0.0001  0 0.3 0.1", "1.057151 0.6001", "0.0793755 0.3  -0.001 0.0004"),
        snapshots=("0.0005", "0.001", "0.005", *SNAPSHOTS),
    ),
    SceneSpec("very_fast", "two balls at 30 m/s", ("0.5 0.4  30 4  10 -200 30", "1.6 0.8  -25 17")),
    SceneSpec("stun_shot", "a cut with next to no spin left at the contact", ("0.9 0.5  2 0  0 -20 0", "1.17 0.53")),
    SceneSpec(
        "other_constants",
        "every constant but gravity and mass changed, on a larger table",
        ("0.4 0.5  3.1 0.7  15 60 -20", "1.3 0.72", "2.1 1  -1.2 -0.4"),
        constants={
            "R": "0.03",
            "mu_slide": "0.15",
            "mu_roll": "0.02",
            "rail_restitution": "0.85",
            "inner_bounds": {"x": ["0.0508", "2.5908"], "y": ["0.0508", "1.3208"]},
        },
    ),
)


def break_balls() -> tuple[str, ...]:
    """Return an eight-ball rack and the cue ball as a shot of (128, 3.8) N for 10 ms on the head spot leaves it.

    Neighbours in the rack are 0.1 mm apart; its apex is on the foot spot. The cue ball meets the apex ball 33 mm off
    its centre: in fuller hits a ball comes to rest in bounces without end against another, out of scope here.
    """
    numbers = ((1,), (9, 2), (10, 8, 3), (11, 4, 12, 5), (6, 13, 7, 14, 15))
    with mp.workdps(DIGITS):
        pitch = 2 * mpf(DEFAULT_CONSTANTS["R"]) + mpf("0.0001")
        balls = {0: "0.6758 0.6369875  8 0.2375"}
        for row, names in enumerate(numbers):
            for place, ball in enumerate(names):
                x = mpf("1.8058") + row * mp.sqrt(3) / 2 * pitch
                y = mpf("0.6358") + (place - mpf(row) / 2) * pitch
                balls[ball] = f"{mp.nstr(x, 17)} {mp.nstr(y, 17)}"
    return tuple(balls[ball] for ball in sorted(balls))


def spec_named(name: str) -> SceneSpec:
    """Return one of `SCENES`."""
    return next(spec for spec in SCENES if spec.name == name)


TRUTH_SCENES = (
    SceneSpec("head_on", "the paper's scene 1: head-on at 5 m/s", ("0.3 0.5  5 0", "1 0.5")),
    SceneSpec("glancing", "the paper's scene 2: as scene 1, 10 mm off the line of centres", ("0.3 0.49  5 0", "1 0.5")),
    SceneSpec("draw", "draw shot: backspin brings the cue ball back", ("0.6 0.6358  3 0  0 -80 0", "1 0.6358")),
    SceneSpec("curve", "curved shot: the spin bends the path", ("0.5 0.4  2.5 0.3  -70 20 15", "1.13 0.545")),
    replace(spec_named("three_rail_bank"), name="bank"),
    spec_named("four_random"),
    SceneSpec("break", "eight-ball break at 8 m/s, 1.7 degrees off the axis", break_balls()),
)


# ---------------------------------------------------------------------------------------------------------------------
# Roots


def horner(coefficients: Sequence[mpf], x: mpf) -> mpf:
    """Return the value at `x` of the polynomial with these coefficients, constant term first."""
    value = mpf(0)
    for coefficient in reversed(coefficients):
        value = value * x + coefficient
    return value


def derivative(coefficients: Sequence[mpf]) -> list[mpf]:
    """Return the coefficients of the derivative."""
    return [k * coefficient for k, coefficient in enumerate(coefficients)][1:]


def bracketed_root(coefficients: Sequence[mpf], low: mpf, high: mpf) -> mpf:
    """Return the root between `low` and `high`, where the signs differ: Newton steps, halving where they leave."""
    slope = derivative(coefficients)
    positive_low = horner(coefficients, low) > 0
    x = (low + high) / 2
    for _ in range(8 * mp.mp.prec):
        value = horner(coefficients, x)
        if value == 0:
            return x
        low, high = (x, high) if (value > 0) == positive_low else (low, x)
        gradient = horner(slope, x)
        newton = x - value / gradient if gradient != 0 else low
        following = newton if low < newton < high else (low + high) / 2
        if abs(following - x) <= 4 * mp.eps:
            return following
        x = following
    raise ArithmeticError("root not found in its bracket")


def isolated_roots(coefficients: Sequence[mpf]) -> list[mpf]:
    """Return, ascending, where the polynomial changes sign on (0, 1): at most once between roots of its derivative."""
    if len(coefficients) < 2:
        return []
    ends = [mpf(0), *isolated_roots(derivative(coefficients)), mpf(1)]
    values = [horner(coefficients, end) for end in ends]
    return [
        bracketed_root(coefficients, ends[k], ends[k + 1])
        for k in range(len(ends) - 1)
        if values[k] * values[k + 1] < 0
    ]


def first_contact(gap: Sequence[mpf], duration: mpf) -> mpf | None:
    """Return the first time in (0, `duration`) at which a gap closes, or None.

    Args:
        gap: polynomial in time, constant term first; positive before contact. Where it is zero at time 0 to
            working precision the contact has just been resolved, and that root is divided out.
        duration: s, for which the polynomial holds.

    Raises:
        ArithmeticError: the two ways of finding the root disagree.
    """
    scaled = [coefficient * duration**k for k, coefficient in enumerate(gap)]
    negligible = max(abs(c) for c in scaled) * mpf(10) ** (12 - mp.mp.dps)
    while abs(scaled[-1]) <= negligible:
        scaled.pop()
    if abs(scaled[0]) <= negligible:
        scaled.pop(0)
    if len(scaled) < 2:
        return None
    if scaled[0] <= 0:
        raise ArithmeticError("balls overlap, or close again where they touch")
    slope = derivative(scaled)
    closing = [x for x in isolated_roots(scaled) if horner(slope, x) < 0]

    agreement = mpf(10) ** (-mp.mp.dps // 2)
    every_root = mp.polyroots(scaled, maxsteps=500, extraprec=2 * mp.mp.prec, asc=True)
    real = [mp.re(x) for x in every_root if abs(mp.im(x)) < agreement]
    checked = sorted(x for x in real if 0 < x < 1 and horner(slope, x) < 0)
    if len(closing) != len(checked) or any(abs(a - b) > agreement for a, b in zip(closing, checked, strict=True)):
        raise ArithmeticError(f"isolation finds {closing}, polyroots {checked}")
    return closing[0] * duration if closing else None


# ---------------------------------------------------------------------------------------------------------------------
# Motion


@dataclass(frozen=True)
class Physics:
    """Constants as numbers; `low` and `high` bound the centre of a ball, (x, y) in m."""

    radius: mpf
    slide: mpf  # m/s^2, deceleration
    roll: mpf
    restitution: mpf
    low: Vector
    high: Vector

    @classmethod
    def read(cls, constants: dict[str, Any], number: Number) -> Physics:
        """Return the constants of a scene, each decimal read by `number`."""
        radius, gravity = number(constants["R"]), number(constants["g"])
        x, y = constants["inner_bounds"]["x"], constants["inner_bounds"]["y"]
        return cls(
            radius=radius,
            slide=number(constants["mu_slide"]) * gravity,
            roll=number(constants["mu_roll"]) * gravity,
            restitution=number(constants["rail_restitution"]),
            low=(number(x[0]) + radius, number(y[0]) + radius),
            high=(number(x[1]) - radius, number(y[1]) - radius),
        )


@dataclass(frozen=True)
class Ball:
    """A ball's motion since `start`: a parabola with linear spin, until `end`. Phase "slide", "roll" or "rest"."""

    start: mpf
    end: mpf
    phase: str
    position: Vector
    velocity: Vector
    spin: tuple[mpf, mpf, mpf]
    acceleration: Vector
    spin_rate: Vector

    def at(self, time: mpf) -> Ball:
        """Return the same motion, anchored at `time`."""
        t = time - self.start
        (px, py), (vx, vy), (wx, wy, wz) = self.position, self.velocity, self.spin
        (ax, ay), (bx, by) = self.acceleration, self.spin_rate
        return replace(
            self,
            start=time,
            position=(px + vx * t + ax * t * t / 2, py + vy * t + ay * t * t / 2),
            velocity=(vx + ax * t, vy + ay * t),
            spin=(wx + bx * t, wy + by * t, wz),
        )


ZERO: Vector = (mpf(0), mpf(0))


def sliding(physics: Physics, time: mpf, position: Vector, velocity: Vector, spin: tuple[mpf, mpf, mpf]) -> Ball:
    """Return the motion after an impulse or at the start: sliding, unless the slip is exactly zero."""
    ux, uy = velocity[0] - physics.radius * spin[1], velocity[1] + physics.radius * spin[0]
    slip = mp.hypot(ux, uy)
    if slip == 0:
        return rolling(physics, time, position, velocity, spin[2])
    push = physics.slide / slip
    turn = mpf(5) / 2 * push / physics.radius
    end = time + 2 * slip / (7 * physics.slide)
    return Ball(time, end, "slide", position, velocity, spin, (-push * ux, -push * uy), (-turn * uy, turn * ux))


def rolling(physics: Physics, time: mpf, position: Vector, velocity: Vector, wz: mpf) -> Ball:
    """Return the motion once the slip has ended: rolling, or rest where there is no velocity."""
    vx, vy = velocity
    speed = mp.hypot(vx, vy)
    if speed == 0:
        return Ball(time, mp.inf, "rest", position, ZERO, (*ZERO, wz), ZERO, ZERO)
    brake, radius = physics.roll / speed, physics.radius
    acceleration = (-brake * vx, -brake * vy)
    spin_rate = (-acceleration[1] / radius, acceleration[0] / radius)
    spin = (-vy / radius, vx / radius, wz)
    return Ball(time, time + speed / physics.roll, "roll", position, velocity, spin, acceleration, spin_rate)


# ---------------------------------------------------------------------------------------------------------------------
# Events

RAILS = (("x-low", 0, -1), ("x-high", 0, 1), ("y-low", 1, -1), ("y-high", 1, 1))  # name, axis, side


def rail_gap(physics: Physics, ball: Ball, axis: int, side: int) -> list[mpf]:
    """Return the distance left to a rail as a polynomial in the time since the ball's start."""
    bound = physics.high[axis] if side > 0 else -physics.low[axis]
    return [bound - side * ball.position[axis], -side * ball.velocity[axis], -side * ball.acceleration[axis] / 2]


def pair_gap(physics: Physics, one: Ball, two: Ball) -> list[mpf]:
    """Return |p + v t + a t^2/2|^2 - (2R)^2 of two balls with the same start."""
    coefficients = [-4 * physics.radius**2] + [mpf(0)] * 4
    for axis in (0, 1):
        p = one.position[axis] - two.position[axis]
        v = one.velocity[axis] - two.velocity[axis]
        a = one.acceleration[axis] - two.acceleration[axis]
        for k, term in enumerate((p * p, 2 * p * v, v * v + p * a, v * a, a * a / 4)):
            coefficients[k] += term
    return coefficients


@dataclass(frozen=True)
class Candidate:
    """An event that happens unless another one changes a ball of it first."""

    time: mpf
    kind: str  # "end", a rail's name, or "ball-ball"
    balls: tuple[int, ...]


def candidates_of(physics: Physics, balls: Sequence[Ball], i: int, now: mpf) -> list[Candidate]:
    """Return what ball `i` meets next: the end of its phase, a rail, each other ball."""
    found: list[Candidate] = []
    ball = balls[i].at(now)
    if ball.phase != "rest":
        found.append(Candidate(ball.end, "end", (i,)))
        for name, axis, side in RAILS:
            wait = first_contact(rail_gap(physics, ball, axis, side), ball.end - now)
            if wait is not None:
                found.append(Candidate(now + wait, name, (i,)))
    for j, other in enumerate(balls):
        if j == i or ball.phase == other.phase == "rest":
            continue
        wait = first_contact(pair_gap(physics, ball, other.at(now)), min(ball.end, other.end) - now)
        if wait is not None:
            found.append(Candidate(now + wait, "ball-ball", (min(i, j), max(i, j))))
    return found


def resolve(physics: Physics, balls: list[Ball], event: Candidate) -> dict[str, Any]:
    """Carry out an event on `balls`; return its record, without the time."""
    states = [balls[i].at(event.time) for i in event.balls]
    one = states[0]
    if event.kind == "end":
        velocity = one.velocity if one.phase == "slide" else ZERO
        balls[event.balls[0]] = rolling(physics, event.time, one.position, velocity, one.spin[2])
        return {"type": f"{one.phase}->{balls[event.balls[0]].phase}", "balls": list(event.balls)}
    if event.kind == "ball-ball":
        two = states[1]
        line = (one.position[0] - two.position[0], one.position[1] - two.position[1])
        distance = mp.hypot(*line)
        normal = (line[0] / distance, line[1] / distance)
        speed = sum((two.velocity[k] - one.velocity[k]) * normal[k] for k in (0, 1))
        for i, state, sign in zip(event.balls, states, (1, -1), strict=True):
            velocity = tuple(state.velocity[k] + sign * speed * normal[k] for k in (0, 1))
            balls[i] = sliding(physics, event.time, state.position, velocity, state.spin)
        return {"type": "ball-ball", "balls": list(event.balls), "normal_approach_speed": speed}
    _, axis, side = next(rail for rail in RAILS if rail[0] == event.kind)
    speed = side * one.velocity[axis]
    velocity = tuple(-physics.restitution * v if k == axis else v for k, v in enumerate(one.velocity))
    balls[event.balls[0]] = sliding(physics, event.time, one.position, velocity, one.spin)
    return {"type": "rail", "balls": list(event.balls), "rail": event.kind, "normal_speed_in": speed}


@dataclass
class Solution:
    """All events of a scene, and the balls at the times asked for and at rest."""

    events: list[dict[str, Any]]
    snapshots: dict[str, list[Ball]]  # by time
    rest_time: mpf
    at_rest: list[Ball]

    def sequence(self) -> list[tuple[Any, ...]]:
        """Return what happens, in order, without the times."""
        return [(event["type"], tuple(event["balls"]), event.get("rail")) for event in self.events]

    def smallest_gap(self) -> mpf:
        """Return the shortest time between two events, s."""
        times = [mpf(0)] + [event["t"] for event in self.events]
        return min(b - a for a, b in zip(times, times[1:], strict=False))


def solve(
    constants: dict[str, Any], initial: Sequence[Sequence[mpf]], times: Sequence[str], number: Number = mpf
) -> Solution:
    """Solve a scene until every ball rests.

    Args:
        constants: as `DEFAULT_CONSTANTS`.
        initial: seven numbers a ball: position, velocity, angular velocity.
        times: s, of the snapshots, in any order.
        number: reads a constant; `mpf` takes it as the exact decimal.

    Raises:
        ArithmeticError: more than `MOST_EVENTS` events.
    """
    physics = Physics.read(constants, number)
    now = mpf(0)
    balls = [sliding(physics, now, (b[0], b[1]), (b[2], b[3]), (b[4], b[5], b[6])) for b in initial]
    pending = {c for i in range(len(balls)) for c in candidates_of(physics, balls, i, now)}
    waiting = sorted(set(times), key=mpf)
    solution = Solution([], {}, now, [])
    while pending:
        event = min(pending, key=lambda candidate: candidate.time)
        while waiting and mpf(waiting[0]) < event.time:
            time = waiting.pop(0)
            solution.snapshots[time] = [ball.at(mpf(time)) for ball in balls]
        if len(solution.events) == MOST_EVENTS:
            raise ArithmeticError(f"more than {MOST_EVENTS} events by {mp.nstr(now, 10)} s")
        now = event.time
        solution.events.append({"t": now, **resolve(physics, balls, event)})
        pending = {c for c in pending if not set(c.balls) & set(event.balls)}
        for i in event.balls:
            pending.update(candidates_of(physics, balls, i, now))
    solution.snapshots |= {time: [ball.at(mpf(time)) for ball in balls] for time in waiting}
    solution.rest_time, solution.at_rest = now, [ball.at(now) for ball in balls]
    return solution


# ---------------------------------------------------------------------------------------------------------------------
# Conditioning and file


def largest_shift(one: Sequence[Ball], two: Sequence[Ball]) -> mpf:
    """Return the largest difference of a position component, m."""
    return max(abs(a.position[k] - b.position[k]) for a, b in zip(one, two, strict=True) for k in (0, 1))


def as_double(decimal: str) -> mpf:
    """Return, exactly, the float64 nearest to a decimal."""
    return mpf(float(decimal))


def conditioning(
    constants: dict[str, Any], initial: list[list[str]], final_time: str, exact: Solution
) -> dict[str, Any]:
    """Return how far the balls move, at the final time and at rest, when the initial values do.

    Rounding the initial values and constants to float64 gives the floor for any float64 solver; perturbing the
    initial values of the moving balls at random tells chaos from error.
    """
    rounded = solve(constants, [[as_double(x) for x in ball] for ball in initial], [final_time], as_double)
    signs = random.Random(1)
    final, rest, same = mpf(0), mpf(0), rounded.sequence() == exact.sequence()
    with mp.workdps(PERTURBED_DIGITS):
        size = mpf(PERTURBATION)
        for _ in range(PERTURBED_RUNS):
            shifted = []
            for ball in initial:
                moving = any(mpf(x) != 0 for x in ball[2:])
                shifted.append([mpf(x) + (signs.choice((-1, 1)) * size if moving else 0) for x in ball])
            other = solve(constants, shifted, [final_time])
            same = same and other.sequence() == exact.sequence()
            final = max(final, largest_shift(other.snapshots[final_time], exact.snapshots[final_time]) / size)
            rest = max(rest, largest_shift(other.at_rest, exact.at_rest) / size)
    return {
        "meaning": "max |dposition| when ICs and constants are rounded to double (floor for any double solver)",
        "at_final_time": mp.nstr(largest_shift(rounded.snapshots[final_time], exact.snapshots[final_time]), 3),
        "same_event_sequence": same,
        "at_rest": mp.nstr(largest_shift(rounded.at_rest, exact.at_rest), 3),
        "amplification_of_1e-12m_at_final_time": mp.nstr(final, 3),
        "amplification_of_1e-12m_at_rest": mp.nstr(rest, 3),
    }


def state_record(balls: Sequence[Ball]) -> list[dict[str, Any]]:
    """Return the balls' JSON record, numbers with 20 significant digits."""

    def text(numbers: Sequence[mpf]) -> list[str]:
        return [mp.nstr(x, 20, strip_zeros=x == 0) for x in numbers]

    return [
        {
            "position": text(ball.position),
            "velocity": text(ball.velocity),
            "angular_velocity": text(ball.spin),
            "phase": ball.phase,
        }
        for ball in balls
    ]


def scene_record(spec: SceneSpec) -> dict[str, Any]:
    """Solve a scene; return its JSON record.

    Raises:
        ValueError: two events are so close that their order is ambiguous.
    """
    constants, initial = {**DEFAULT_CONSTANTS, **spec.constants}, spec.initial()
    exact = solve(constants, [[mpf(x) for x in ball] for ball in initial], [*spec.snapshots, spec.final_time])
    gap = exact.smallest_gap()
    if gap < mpf(SMALLEST_GAP):
        raise ValueError(f"{spec.name}: two events only {mp.nstr(gap, 3)} s apart")
    events = []
    for event in exact.events:
        record = {**event, "t": mp.nstr(event["t"], 20, strip_zeros=False)}
        for key in ("normal_approach_speed", "normal_speed_in"):
            if key in record:
                record[key] = mp.nstr(record[key], 20)
        events.append(record)
    kinds = [event["type"] for event in events]
    record = {
        "name": spec.name,
        "description": spec.description,
        "n_balls": len(initial),
        "initial": [{"position": b[:2], "velocity": b[2:4], "angular_velocity": b[4:]} for b in initial],
        "final_time": spec.final_time,
        "state_at_final_time": state_record(exact.snapshots[spec.final_time]),
        "snapshots": {time: state_record(exact.snapshots[time]) for time in spec.snapshots},
        "events": events,
        "rest_time": mp.nstr(exact.rest_time, 20, strip_zeros=False),
        "state_at_rest": state_record(exact.at_rest),
        "conditioning": conditioning(constants, initial, spec.final_time, exact),
        "n_events": {
            "total": len(events),
            "ball_ball": kinds.count("ball-ball"),
            "rail": kinds.count("rail"),
            "min_gap_s": float(gap),
        },
    }
    return record | ({"constants": constants} if spec.constants else {})


def kinetic_energy(constants: dict[str, Any], balls: Sequence[Ball]) -> mpf:
    """Return the energy of all balls, linear and rotational, J."""
    mass, radius = mpf(constants["m"]), mpf(constants["R"])
    squares = [sum(v * v for v in ball.velocity) + radius**2 * sum(w * w for w in ball.spin) * 2 / 5 for ball in balls]
    return mass * sum(squares) / 2


def truth_record(spec: SceneSpec) -> dict[str, Any]:
    """Solve a scene of the benchmark; return its JSON record.

    Raises:
        ArithmeticError: the solutions with the two numbers of digits differ.
    """
    constants, initial = DEFAULT_CONSTANTS, spec.initial()
    solutions = []
    for digits in TRUTH_DIGITS:
        with mp.workdps(digits):
            solutions.append(solve(constants, [[mpf(x) for x in ball] for ball in initial], TRUTH_TIMES))
    rough, exact = solutions
    with mp.workdps(TRUTH_DIGITS[-1]):
        rounded = solve(constants, [[as_double(x) for x in ball] for ball in initial], TRUTH_TIMES, as_double)

        def instants(solution: Solution) -> dict[str, list[Ball]]:
            return {**{time: solution.snapshots[time] for time in TRUTH_TIMES}, "rest": solution.at_rest}

        for time, balls in instants(exact).items():
            if largest_shift(balls, instants(rough)[time]) > mpf(TRUTH_AGREEMENT):
                raise ArithmeticError(f"{spec.name}: {TRUTH_DIGITS} digits differ at {time}: use more")
        return {
            "name": spec.name,
            "description": spec.description,
            "initial": initial,
            "rest_time": mp.nstr(exact.rest_time, 20),
            "initial_energy": mp.nstr(kinetic_energy(constants, [sliding_start(constants, b) for b in initial]), 20),
            "states": {
                time: {
                    "positions": [[mp.nstr(x, 20) for x in ball.position] for ball in balls],
                    "energy": mp.nstr(kinetic_energy(constants, balls), 20),
                    "rounding": mp.nstr(largest_shift(balls, instants(rounded)[time]), 3),
                }
                for time, balls in instants(exact).items()
            },
            "collisions": [
                [mp.nstr(event["t"], 20), event["balls"], event.get("rail")]
                for event in exact.events
                if event["type"] in ("ball-ball", "rail")
            ],
        }


def sliding_start(constants: dict[str, Any], ball: Sequence[str]) -> Ball:
    """Return the motion of a ball from its seven initial decimals."""
    b = [mpf(x) for x in ball]
    return sliding(Physics.read(constants, mpf), mpf(0), (b[0], b[1]), (b[2], b[3]), (b[4], b[5], b[6]))


def spec_from_record(record: dict[str, Any], constants: dict[str, Any]) -> SceneSpec:
    """Return what a scene of a file asks to solve."""
    balls = tuple(
        " ".join(ball["position"] + ball["velocity"] + ball["angular_velocity"]) for ball in record["initial"]
    )
    return SceneSpec(
        record["name"],
        record["description"],
        balls,
        record.get("constants", constants),
        tuple(sorted(record["snapshots"], key=float)),
        record["final_time"],
    )


def verify(path: str) -> None:
    """Solve the scenes of a file again and print, for each, the largest differences from what it says."""

    def sequence(record: dict[str, Any]) -> list[tuple[Any, ...]]:
        return [(event["type"], event["balls"], event.get("rail")) for event in record["events"]]

    def numbers(record: dict[str, Any]) -> list[mpf]:
        listed = [record["snapshots"][time] for time in sorted(record["snapshots"], key=float)]
        listed += [record["state_at_final_time"], record["state_at_rest"]]
        keys = ("position", "velocity", "angular_velocity")
        return [mpf(x) for balls in listed for ball in balls for key in keys for x in ball[key]]

    def difference(one: Sequence[mpf], two: Sequence[mpf]) -> str:
        return mp.nstr(max(abs(a - b) for a, b in zip(one, two, strict=True)), 2)

    with open(path, encoding="utf-8") as file:
        data = json.load(file)
    print(f"{'scene':24} {'events':>6}  same  largest difference in time, s, and state")
    for record in data["scenes"]:
        again = scene_record(spec_from_record(record, data["constants"]))
        times = difference(*([mpf(event["t"]) for event in r["events"]] for r in (record, again)))
        states = difference(numbers(record), numbers(again))
        same = sequence(record) == sequence(again)
        print(f"{record['name']:24} {len(record['events']):6}  {same!s:5} {times} {states}")


def truth_document() -> dict[str, Any]:
    """Solve the benchmark's scenes; return the content of the file."""
    return {
        "format": 'decimal strings, SI units; "initial": x y vx vy wx wy wz of each ball, exact; "rounding": m, how '
        "far the balls move when initial values and constants are rounded to double; a collision: time, balls, rail",
        "constants": DEFAULT_CONSTANTS,
        "scenes": [truth_record(spec) for spec in TRUTH_SCENES],
    }


def write(path: str, document: dict[str, Any]) -> None:
    """Write JSON."""
    with open(path, "w", encoding="utf-8") as file:
        json.dump(document, file, indent=1)
        file.write("\n")


def main() -> None:
    """Write the scenes, or verify a file of them."""
    parser = argparse.ArgumentParser(description="Solve reference scenes in multiprecision arithmetic.")
    target = parser.add_mutually_exclusive_group(required=True)
    target.add_argument("output", nargs="?", help="JSON file to write")
    target.add_argument("--verify", metavar="FILE", help="JSON file whose scenes to solve again")
    target.add_argument("--truth", metavar="FILE", help="JSON file to write for the benchmark")
    arguments = parser.parse_args()
    mp.mp.dps = DIGITS
    if arguments.verify:
        verify(arguments.verify)
        return
    if arguments.truth:
        write(arguments.truth, truth_document())
        return
    document = {
        "format": "positions m, velocities m/s, angular velocities rad/s, times s; numbers are decimal strings (20 "
        'significant digits); ball indices are 0-based in the order of "initial"; initial values and constants are '
        'EXACT decimals; a scene with "constants" of its own uses those',
        "model": MODEL,
        "constants": DEFAULT_CONSTANTS,
        "scenes": [scene_record(spec) for spec in SCENES],
    }
    write(arguments.output, document)


if __name__ == "__main__":
    main()
