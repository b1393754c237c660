# SPDX-License-Identifier: Apache-2.0
"""Contact times of 1.1 million pairs of balls, solved in exact arithmetic.

Independent of the engine it is meant to check: no shared code, only the same definition of a contact. A pair is a
relative position, velocity and acceleration and a horizon, seven doubles. Doubles are integers times powers of two, so
|p + v t + a t^2/2|^2 - D^2 on [0, horizon] is a polynomial with integer coefficients: its roots are counted and
isolated without rounding (Descartes' rule of signs on Bernstein coefficients, halving), then bracketed to
horizon/2^200, more than 50 digits of the horizon.

A contact is the first time at which the distance falls through D. A pair that touches, |p| <= D + TOUCH, has three
cases: it approaches and |p| <= D, then the contact is at 0; it separates, then the contact is when it comes back; it
does neither, p . v = 0, and is pulled together, then the contact is when it is closer by TOUCH. What separates and
turns back while no more than FURTHEST apart has not come apart: the contact is when it is closer by TOUCH than at its
furthest, or than D if that is less. Every touching pair here is a clear case: p . v is 0 or |p . v| > 1e-5 m/s D.

The margin of a pair is x of its distance D (1 + x) at the closest point or, still approaching, at the horizon; where
there are several, the x nearest to 0. It says how nearly a hit would have been a miss or a miss a hit.

    make_contact_times.py OUT.npz                        solve every pair and write the solutions (two minutes)
    make_contact_times.py --verify FILE.npz [--every N]  solve every Nth pair of a file again and compare
"""

from __future__ import annotations

import argparse
import hashlib
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

DIAMETER = 0.05715  # m
SLIDING = 0.2 * 9.81  # m/s^2
ROLLING = 0.01 * 9.81  # m/s^2
TOUCH = 1e-13  # m
FURTHEST = 1e-15  # m

SEED = 20140501
BLOCK = 50_000  # pairs made from one stream of random bits
RANDOM_BLOCKS = 20
GRAZE_BLOCKS = 2
NEAR = 20  # margins of random pairs are noted below 2^-NEAR

BITS = 200  # of a root, as a fraction of the horizon
DEEPEST = 120  # halvings that isolate a root: a closest distance is told from D down to x = 1e-60 or so

Array = NDArray[np.float64]
Polynomial = Sequence[int]


# ---------------------------------------------------------------------------------------------------------------------
# Pairs. Every operation here is one that IEEE 754 rounds correctly, so the doubles are the same everywhere.


class Stream:
    """Columns of random numbers, each made from 64-bit words of one generator."""

    def __init__(self, kind: int, block: int) -> None:
        self._bits = np.random.PCG64([SEED, kind, block])

    def uniform(self) -> Array:
        """In (0, 1], steps of 2^-53."""
        return ((self._bits.random_raw(BLOCK) >> np.uint64(11)) + np.uint64(1)).astype(np.float64) * 2.0**-53

    def signed(self) -> Array:
        """In (-1, 1]."""
        return 2.0 * self.uniform() - 1.0

    def index(self, count: int) -> NDArray[np.int64]:
        """0 to count - 1."""
        return ((self._bits.random_raw(BLOCK) >> np.uint64(11)) % np.uint64(count)).astype(np.int64)

    def octaves(self, low: int, high: int) -> Array:
        """From 2^low to 2^high, as many in every octave."""
        return np.ldexp(1.0 + self.uniform(), (low + self.index(high - low)).astype(np.int32))

    def direction(self) -> tuple[Array, Array]:
        """Unit vectors."""
        x, y = self.signed(), self.signed()
        length = np.sqrt(x * x + y * y)
        return x / length, y / length


def ball(stream: Stream, phase: NDArray[np.int64]) -> tuple[Array, Array, Array, Array, Array]:
    """Velocity, acceleration and duration of the motion of a ball at rest (0), rolling (1) or sliding (2).

    Speeds and slips are 1e-3 to 128 m/s, a few of the sliding balls start from v = 0; the motion lasts until its phase
    ends or it may have gone up to 3 m, when it would have met a rail.
    """
    rolls, slides = phase == 1, phase == 2
    cx, cy = stream.direction()
    dx, dy = stream.direction()
    speed = stream.octaves(-10, 7)
    speed = np.where(rolls | (slides & (stream.index(16) > 0)), speed, 0.0)
    slip = stream.octaves(-10, 7)
    way = 3.0 * stream.uniform()
    ax = np.where(rolls, -ROLLING * cx, np.where(slides, SLIDING * dx, 0.0))
    ay = np.where(rolls, -ROLLING * cy, np.where(slides, SLIDING * dy, 0.0))
    with np.errstate(divide="ignore"):
        rail = np.minimum(way / speed, np.sqrt(2.0 * way / np.where(slides, SLIDING, 0.0)))
    end = np.where(rolls, speed / ROLLING, np.where(slides, slip / (3.5 * SLIDING), np.inf))
    return speed * cx, speed * cy, ax, ay, np.minimum(end, rail)


def random_pairs(block: int) -> Array:
    """(BLOCK, 7) px, py, vx, vy, ax, ay, horizon in SI of pairs in every combination of phases.

    Of 100 pairs about 30 start anywhere on a table, 50 are aimed at up to 2.5 diameters beside each other, 8 start a
    picometre to a decimetre apart, 8 touch or overlap and 4 move along their line of centres.
    """
    s = Stream(0, block)
    phases = s.index(73)  # rest and rest, which has no contact, is rare
    phases = np.where(phases < 72, 1 + phases // 9, 0)
    vx, vy, ax, ay, end = ball(s, phases // 3)
    ux, uy, bx, by, other_end = ball(s, phases % 3)
    together = (phases == 8) & (s.index(4) == 0)  # two that slide the same way: straight relative motion
    vx, vy = vx - ux, vy - uy
    ax, ay = np.where(together, 0.0, ax - bx), np.where(together, 0.0, ay - by)
    horizon = np.minimum(end, other_end)
    horizon = np.where(np.isfinite(horizon), horizon, 1.0)

    group = s.index(100)
    touching = (group >= 88) & (group < 96)
    straight = group >= 96

    nx, ny = s.direction()
    aside = 2.5 * s.uniform() * DIAMETER
    t = 1.1 * s.uniform() * horizon
    aimed_x, aimed_y = nx * aside - (vx + 0.5 * ax * t) * t, ny * aside - (vy + 0.5 * ay * t) * t
    px = np.where(group < 30, 2.4 * s.signed(), aimed_x)
    py = np.where(group < 30, 1.2 * s.signed(), aimed_y)

    py, vy, ay = (np.where(straight, 0.0, values) for values in (py, vy, ay))
    px = np.where(straight & (px == 0.0), 1.0, px)

    distance = np.sqrt(px * px + py * py)
    apart = np.where(distance < 1.001 * DIAMETER, (1.001 + s.uniform()) * DIAMETER / distance, 1.0)
    px, py = px * apart, py * apart

    gap = s.octaves(-40, -3)
    how = s.index(4)
    slight = 0.9 * TOUCH * s.signed()
    overlap = -s.octaves(-40, -13)
    gap = np.where(touching, np.choose(how, (0.0, 0.0, slight, overlap)), gap)
    beside = (group >= 80) & (group < 96)
    px, py = np.where(beside, nx * (DIAMETER + gap), px), np.where(beside, ny * (DIAMETER + gap), py)
    undecided = touching & (np.abs(px * vx + py * vy) < 1e-5 * DIAMETER * (1.0 + np.abs(vx) + np.abs(vy)))
    vx, vy = np.where(undecided, 0.0625 * px, vx), np.where(undecided, 0.0625 * py, vy)

    neither = touching & (how == 0)
    along_x = s.index(2) == 0
    px = np.where(neither, np.where(along_x, DIAMETER, 0.0), px)
    py = np.where(neither, np.where(along_x, 0.0, -DIAMETER), py)
    still = s.index(4) == 0
    vx = np.where(neither & (along_x | still), 0.0, vx)
    vy = np.where(neither & (~along_x | still), 0.0, vy)
    return np.stack((px, py, vx, vy, ax, ay, horizon), axis=1)


def grazing_pairs(block: int) -> Array:
    """(BLOCK, 7) as `random_pairs`, of pairs that pass at a distance D (1 + x), 7e-15 < |x| < 1e-3 of either sign.

    Half of them move straight to each other, half on a parabola; the rounding of the inputs changes x by up to 1e-14.
    """
    s = Stream(1, block)
    nx, ny = s.direction()
    near = DIAMETER * (1.0 + np.where(s.index(2) == 0, 1.0, -1.0) * s.octaves(-47, -10))
    speed = np.where(s.index(2) == 0, 1.0, -1.0) * s.octaves(-10, 7)
    dx, dy = s.direction()
    ex, ey = s.direction()
    other = np.choose(s.index(3), (0.0, ROLLING, SLIDING))
    curved = s.index(2) == 0
    ax = np.where(curved, SLIDING * dx - other * ex, 0.0)
    ay = np.where(curved, SLIDING * dy - other * ey, 0.0)
    away = speed * speed + near * (nx * ax + ny * ay) > 0.0  # else the furthest point, not the closest
    ax, ay = np.where(away, ax, -ax), np.where(away, ay, -ay)
    way = 0.01 + 2.5 * s.uniform()
    longest = 8.0 * s.uniform()
    beyond = 1.0 + s.uniform()
    for _ in range(2):
        with np.errstate(divide="ignore"):
            bend = np.sqrt(2.0 * way / np.sqrt(ax * ax + ay * ay))
        t = np.minimum(np.minimum(way / np.abs(speed), bend), longest)
        wx, wy = -ny * speed, nx * speed
        px = nx * near - (wx - 0.5 * ax * t) * t
        py = ny * near - (wy - 0.5 * ay * t) * t
        # What starts too close comes straight and fast instead.
        close = px * px + py * py < (1.0001 * DIAMETER) * (1.0001 * DIAMETER)
        ax, ay = np.where(close, 0.0, ax), np.where(close, 0.0, ay)
        speed = np.where(close, 1.0, speed)
        way = np.where(close, 0.5, way)
        longest = np.where(close, 1.0, longest)
    return np.stack((px, py, wx - ax * t, wy - ay * t, ax, ay, t * beyond), axis=1)


# ---------------------------------------------------------------------------------------------------------------------
# Roots on (0, 1) of polynomials with integer coefficients


def variations(bernstein: Polynomial) -> int:
    """Sign changes, zeros skipped: no fewer than the roots in (0, 1), and as many where that is 0 or 1."""
    signs = [b > 0 for b in bernstein if b]
    return sum(one != other for one, other in zip(signs, signs[1:]))


def halves(bernstein: Polynomial) -> tuple[list[int], list[int]]:
    """The polynomial on (0, 1/2) and on (1/2, 1), both times 2^degree (de Casteljau)."""
    row = list(bernstein)
    degree = len(row) - 1
    left, right = [row[0] << degree], [row[-1] << degree]
    for k in range(degree - 1, -1, -1):
        row = [one + other for one, other in zip(row, row[1:])]
        left.append(row[0] << k)
        right.append(row[-1] << k)
    return left, right[::-1]


def sign_changes(bernstein: Polynomial) -> Iterator[tuple[int, int, bool]]:
    """Where the polynomial changes sign in (0, 1), ascending: low and high in units of 2^-BITS, whether it falls."""
    stack: list[tuple[Polynomial, int, int]] = [(bernstein, 0, 0)]
    while stack:
        part, place, level = stack.pop()
        changes = variations(part)
        if changes == 0:
            continue
        if changes == 1:
            unit = BITS - level
            yield place << unit, (place + 1) << unit, next(b for b in part if b) > 0
            continue
        if level == DEEPEST:
            raise ArithmeticError("a double root, or two roots too close to tell apart")
        left, right = halves(part)
        stack.append((right, 2 * place + 1, level + 1))
        if left[-1] == 0:  # a root at the middle itself, which belongs to neither half
            before, after = next(b for b in left[::-1] if b), next(b for b in right if b)
            stack.append(((before, after), (2 * place + 1) << (BITS - level - 1), BITS))
        stack.append((left, 2 * place, level + 1))


def value(polynomial: Polynomial, s: int) -> int:
    """At s/2^BITS, times 2^(BITS degree); coefficients from the constant term on."""
    total, shift = polynomial[-1], 0
    for coefficient in polynomial[-2::-1]:
        shift += BITS
        total = total * s + (coefficient << shift)
    return total


def refine(polynomial: Polynomial, low: int, high: int, falls: bool) -> int:
    """The root in (low, high), at which the sign changes once, rounded down to a multiple of 2^-BITS.

    Newton's method, halving where it leaves the bracket; the signs on both sides of the result are certain.
    """
    slope = [k * coefficient for k, coefficient in enumerate(polynomial)][1:]
    s = (low + high) >> 1
    steps = 0
    while high - low > 1:
        steps += 1
        at = value(polynomial, s)
        if (at > 0) == falls and at != 0:
            low = s
        else:
            high = s
        gradient = value(slope, s)
        s = s - at // gradient if gradient and steps < 40 else low - 1
        if low - 4 <= s <= low:
            s = low + 1
        elif high <= s <= high + 4:
            s = high - 1
        if not low < s < high:
            s = (low + high) >> 1
    return low


# ---------------------------------------------------------------------------------------------------------------------
# Contacts


def dyadic(number: float) -> tuple[int, int]:
    """(n, k) with number = n/2^k."""
    numerator, denominator = number.as_integer_ratio()
    return numerator, denominator.bit_length() - 1


class Pair:
    """A pair in integers: the coefficients of x and y over s = t/horizon, in units of 2^-scale m."""

    def __init__(self, px: float, py: float, vx: float, vy: float, ax: float, ay: float, horizon: float) -> None:
        t, t_shift = dyadic(horizon)
        terms = [dyadic(number) for number in (px, py, vx, vy, ax, ay)]
        factors = ((1, 0), (1, 0), (t, t_shift), (t, t_shift), (t * t, 2 * t_shift + 1), (t * t, 2 * t_shift + 1))
        diameter, diameter_shift = dyadic(DIAMETER)
        shifts = [shift + more for (_, shift), (_, more) in zip(terms, factors)]
        self.scale = scale = max(*shifts, diameter_shift, BITS) + 1  # one more: coefficients are even
        px_, py_, vx_, vy_, ax_, ay_ = (
            number * factor << (scale - shift) for (number, _), (factor, _), shift in zip(terms, factors, shifts)
        )
        self.x, self.y = (px_, vx_, ax_), (py_, vy_, ay_)
        self.diameter = diameter << (scale - diameter_shift)
        self.horizon, self.horizon_shift = t, t_shift

    def gap(self, square: int) -> list[int]:
        """Bernstein coefficients of |q|^2 - square, times 3; square in units of 4^-scale m^2."""
        total = [-3 * square] * 5
        for p, v, a in (self.x, self.y):
            middle, end = p + v // 2, p + v + a
            for k, term in enumerate(
                (3 * p * p, 3 * p * middle, p * end + 2 * middle * middle, 3 * middle * end, 3 * end * end)
            ):
                total[k] += term
        return total

    def quartic(self, square: int) -> list[int]:
        """Coefficients of |q|^2 - square over s, from the constant term on."""
        total = [-square, 0, 0, 0, 0]
        for p, v, a in (self.x, self.y):
            for k, term in enumerate((p * p, 2 * p * v, v * v + 2 * p * a, 2 * v * a, a * a)):
                total[k] += term
        return total

    def parting(self) -> list[int]:
        """Coefficients of q . dq/ds over s."""
        return [(k + 1) * coefficient // 2 for k, coefficient in enumerate(self.quartic(0)[1:])]

    def parting_bernstein(self) -> list[int]:
        """Bernstein coefficients of q . dq/ds, times 3."""
        c0, c1, c2, c3 = self.parting()
        return [3 * c0, 3 * c0 + c1, 3 * c0 + 2 * c1 + c2, 3 * (c0 + c1 + c2 + c3)]

    def length(self, number: float) -> int:
        """In units of 2^-(scale + 2 BITS) m."""
        numerator, shift = dyadic(number)
        return numerator << (self.scale + 2 * BITS - shift)

    def distance(self, s: int) -> int:
        """At s/2^BITS, in units of 2^-(scale + 2 BITS) m, rounded down."""
        x, y = value(self.x, s), value(self.y, s)
        return math.isqrt(x * x + y * y)

    def seconds(self, s: int) -> float:
        """The time half a unit after s/2^BITS, rounded once."""
        return (2 * s + 1) * self.horizon / (1 << (BITS + 1 + self.horizon_shift))

    def first_fall(self, square: int) -> float:
        """When |q|^2 first falls through square, s; INF if it does not."""
        bernstein = self.gap(square)
        for low, high, falls in sign_changes(bernstein):
            if falls:
                return self.seconds(refine(self.quartic(square), low, high, falls))
        if bernstein[-1] == 0 and bernstein[-2] > 0:  # at the horizon itself, and still falling
            return self.horizon / (1 << self.horizon_shift)
        return math.inf

    def _turns(self) -> Iterator[tuple[int, bool]]:
        for low, high, falls in sign_changes(self.parting_bernstein()):
            yield refine(self.parting(), low, high, falls), falls

    def margin(self) -> float:
        """See the head of this file; INF if the pair has no closest point and does not approach at the horizon."""
        bernstein = self.parting_bernstein()
        points = [s for s, falls in self._turns() if not falls]
        if bernstein[-1] < 0:
            points.append(1 << BITS)
        unit = self.length(DIAMETER)
        return min(((self.distance(s) - unit) / unit for s in points), key=abs, default=math.inf)

    def is_far(self) -> bool:
        """Whether the pair never comes closer than D (1 + 2 2^-NEAR)."""
        square = self.diameter * self.diameter
        return min(self.gap(square)) << NEAR > 3 * 5 * square

    def contact(self) -> float:
        """First contact, s; INF if there is none."""
        square = self.diameter * self.diameter
        start = self.x[0] * self.x[0] + self.y[0] * self.y[0]
        unit, closer, apart = (self.length(number) for number in (DIAMETER, TOUCH, FURTHEST))
        approach = self.parting()[0]
        if self.distance(0) > unit + closer:
            return self.first_fall(square)
        if approach < 0:
            return 0.0 if start <= square else self.first_fall(square)
        bernstein = self.parting_bernstein()
        pulled = approach == 0 and next((b for b in bernstein if b), 0) < 0
        turn = 0 if pulled else next((s for s, falls in self._turns() if falls), None)
        if turn is None:
            return math.inf
        furthest = self.distance(turn)
        if not pulled and abs(furthest - unit - apart) < apart >> 2:
            raise ArithmeticError("neither come apart nor still together")
        if furthest > unit + apart:
            return self.first_fall(square)
        return self.first_fall((min(furthest, unit) - closer) ** 2 >> (4 * BITS))


def solve(pair: Sequence[float], every_margin: bool) -> tuple[float, float]:
    """First contact of a pair, s, and its margin; the margin of a pair that stays clear is INF unless wanted."""
    exact = Pair(*pair)
    if not every_margin and exact.is_far():
        return math.inf, math.inf
    return exact.contact(), exact.margin()


# ---------------------------------------------------------------------------------------------------------------------
# The file


KINDS: dict[str, tuple[Callable[[int], Array], int]] = {
    "random": (random_pairs, RANDOM_BLOCKS),
    "grazing": (grazing_pairs, GRAZE_BLOCKS),
}


def pairs(kind: str, blocks: int | None = None) -> Array:
    """(N, 7) the pairs of a kind, of its first blocks or of all."""
    make, count = KINDS[kind]
    return np.concatenate([make(block) for block in range(count if blocks is None else blocks)])


def digest(inputs: Array) -> str:
    """Of the bits of the inputs."""
    return hashlib.sha256(inputs.astype("<f8").tobytes()).hexdigest()


def solve_all(kind: str, inputs: Array) -> tuple[Array, Array]:
    """(N,) first contacts, s, and (N,) margins."""
    times, margins = np.empty(len(inputs)), np.empty(len(inputs))
    for i, pair in enumerate(inputs.tolist()):
        times[i], margins[i] = solve(pair, kind == "grazing")
        if i % 1000 == 999:
            print(f"\r{kind}: {100 * (i + 1) // len(inputs)} %", end="", file=sys.stderr)
    print(f"\r{kind}: {len(inputs)} pairs", file=sys.stderr)
    return times, margins


def write(path: Path) -> None:
    """Solve every pair and write, for each kind,

    KIND_hit: the bit of each pair, whether it has a contact, packed;
    KIND_time: s, the first contact of each pair that has one;
    KIND_digest: of the inputs, of the first block and of all;
    grazing_margin: of every pair, rounded to float32;
    random_near, random_near_margin: the pairs with a margin under 2^-NEAR, and it.
    """
    data = {}
    for kind in KINDS:
        inputs = pairs(kind)
        times, margins = solve_all(kind, inputs)
        hit = np.isfinite(times)
        data[f"{kind}_hit"] = np.packbits(hit)
        data[f"{kind}_time"] = times[hit]
        data[f"{kind}_digest"] = np.array([digest(inputs[:BLOCK]), digest(inputs)])
        if kind == "grazing":
            data["grazing_margin"] = margins.astype(np.float32)
        else:
            near = np.flatnonzero(np.abs(margins) < 2.0**-NEAR)
            data["random_near"], data["random_near_margin"] = near, margins[near]
    np.savez_compressed(path, **data)


def read(path: Path) -> dict[str, tuple[Array, Array]]:
    """(N,) first contacts of each kind, INF for none, and (N,) margins, INF where they are not noted."""
    solutions = {}
    with np.load(path) as data:
        for kind, (_, blocks) in KINDS.items():
            times = np.full(blocks * BLOCK, np.inf)
            hit = np.unpackbits(data[f"{kind}_hit"], count=len(times)).astype(bool)
            times[hit] = data[f"{kind}_time"]
            margins = np.full(len(times), np.inf)
            if kind == "grazing":
                margins[:] = data["grazing_margin"]
            else:
                margins[data["random_near"]] = data["random_near_margin"]
            solutions[kind] = times, margins
    return solutions


def verify(path: Path, every: int) -> bool:
    """Whether every Nth solution in a file comes out again, and the inputs are those that it was made from."""
    same = True
    solutions = read(path)
    with np.load(path) as data:
        digests = {kind: data[f"{kind}_digest"] for kind in KINDS}
    for kind in KINDS:
        inputs = pairs(kind)
        same &= bool(digests[kind][1] == digest(inputs))
        times, margins = solve_all(kind, inputs[::every])
        if kind == "grazing":
            margins = margins.astype(np.float32).astype(np.float64)
        else:
            margins = np.where(np.abs(margins) < 2.0**-NEAR, margins, np.inf)
        same &= np.array_equal(times, solutions[kind][0][::every])
        same &= np.array_equal(margins, solutions[kind][1][::every])
    return same


def main() -> int:
    parser = argparse.ArgumentParser(description="solve the contacts of random pairs of balls to 50 digits")
    parser.add_argument("out", nargs="?", type=Path, metavar="OUT.npz")
    parser.add_argument("--verify", type=Path, metavar="FILE.npz")
    parser.add_argument("--every", type=int, default=1, metavar="N")
    arguments = parser.parse_args()
    if (arguments.out is None) == (arguments.verify is None):
        parser.error("give OUT.npz or --verify FILE.npz")
    if arguments.out is not None:
        write(arguments.out)
        return 0
    same = verify(arguments.verify, arguments.every)
    print("the same" if same else "different")
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())
