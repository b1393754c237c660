// SPDX-License-Identifier: Apache-2.0
// How balls move, in closed form. A ball's motion is a list of arcs in order, each valid until the next begins:
// [t, x, y, vx, vy, ax, ay, wx, wy, wz, alpha_x, alpha_y, alpha_z] in s, m, rad, x and y from the centre of the table.
// Positions come from the operations of the engine in its order, so they have the engine's bits.

const MOST_TURN = 0.1; // rad, largest turn in a step where the axis of rotation turns too
const BEND = 0.0005; // m, how far a drawn line may lie beside a path

/** Index of the arc that a ball is on at a time: of several that begin then, the last. */
export function arcAt(arcs, time) {
  let low = 0;
  let high = arcs.length;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (arcs[middle][0] <= time) low = middle;
    else high = middle;
  }
  return low;
}

function placeOn(arc, time, centre) {
  const age = time - arc[0];
  return [
    arc[1] + (arc[3] + 0.5 * arc[5] * age) * age + centre[0],
    arc[2] + (arc[4] + 0.5 * arc[6] * age) * age + centre[1],
  ];
}

/** [x, y] of a ball at a time, or null where it is not in play. */
export function placeAt(arcs, time, centre) {
  return arcs.length ? placeOn(arcs[arcAt(arcs, time)], time, centre) : null;
}

/** Points [x, y] that the path of a ball is drawn through, from its start to a time. */
export function pathUntil(arcs, end, centre) {
  if (!arcs.length) return [];
  const points = [placeOn(arcs[0], Math.max(arcs[0][0], 0), centre)];
  arcs.forEach((arc, index) => {
    const from = arc[0];
    const to = Math.min(index + 1 < arcs.length ? arcs[index + 1][0] : end, end);
    const moves = arc[3] !== 0 || arc[4] !== 0 || arc[5] !== 0 || arc[6] !== 0;
    if (to <= from || !moves) return;
    const bend = (Math.hypot(arc[5], arc[6]) * (to - from) ** 2) / 8;
    const parts = Math.min(Math.max(1, Math.ceil(Math.sqrt(bend / BEND))), 100);
    for (let part = 1; part <= parts; part += 1) points.push(placeOn(arc, from + ((to - from) * part) / parts, centre));
  });
  return points;
}

/** When every ball of a run rests and none spins, s; null where that is not before its end. */
export function restOf({ arcs, end }) {
  const times = arcs.filter((one) => one.length).map((one) => {
    const [t, , , vx, vy, ax, ay, , , wz, , , az] = one[one.length - 1];
    if (vx !== 0 || vy !== 0 || ax !== 0 || ay !== 0) return Infinity;
    return az === 0 ? t : t - wz / az;
  });
  const rest = Math.max(0, ...times);
  return rest <= end + 1e-9 ? Math.min(rest, end) : null; // rounding
}

/** How balls are turned over a run: quaternions [x, y, z, w], from those at its start. */
export class Turning {
  constructor(run, starts) {
    this.arcs = run.arcs;
    // how each ball is turned where its arcs begin
    this.begun = run.arcs.map((arcs, ball) => {
      const turns = [starts[ball]];
      for (let index = 1; index < arcs.length; index += 1) {
        const from = index === 1 ? Math.max(arcs[0][0], 0) : arcs[index - 1][0];
        turns.push(turned(turns[index - 1], arcs[index - 1], from, arcs[index][0]));
      }
      return turns;
    });
  }

  /** How a ball is turned at a time. */
  at(ball, time) {
    const arcs = this.arcs[ball];
    if (!arcs.length) return this.begun[ball][0];
    const index = arcAt(arcs, time);
    return turned(this.begun[ball][index], arcs[index], Math.max(arcs[index][0], 0), time);
  }
}

function turned(start, arc, from, to) {
  const [wx, wy, wz, ax, ay, az] = arc.slice(7);
  if (az !== 0) {
    const stop = arc[0] - wz / az; // the spin about the vertical ends
    if (stop < to) {
      const middle = Math.max(stop, from);
      const until = steadily(start, [wx, wy, wz], [ax, ay, az], from - arc[0], middle - from);
      return steadily(until, [wx, wy, 0], [ax, ay, 0], middle - arc[0], to - middle);
    }
  }
  return steadily(start, [wx, wy, wz], [ax, ay, az], from - arc[0], to - from);
}

// By w + alpha t: the exponent of the Magnus series to fourth order, h w(h/2) - h^3/12 w x alpha.
function steadily(start, w0, alpha, age, duration) {
  if (!(duration > 0)) return start;
  const w = w0.map((part, axis) => part + alpha[axis] * age);
  const cross = [
    w[1] * alpha[2] - w[2] * alpha[1],
    w[2] * alpha[0] - w[0] * alpha[2],
    w[0] * alpha[1] - w[1] * alpha[0],
  ];
  const rate = Math.hypot(...w) + Math.hypot(...alpha) * duration;
  const steps = Math.hypot(...cross) > 1e-9 * rate ? 1 + Math.floor((rate * duration) / MOST_TURN) : 1;
  const h = duration / steps;
  const twist = (h * h * h) / 12;
  let q = start;
  for (let step = 0; step < steps; step += 1) {
    q = rotated(
      q,
      h * (w[0] + 0.5 * h * alpha[0]) - twist * cross[0],
      h * (w[1] + 0.5 * h * alpha[1]) - twist * cross[1],
      h * (w[2] + 0.5 * h * alpha[2]) - twist * cross[2],
    );
    for (let axis = 0; axis < 3; axis += 1) w[axis] += h * alpha[axis];
  }
  return q;
}

/** The turn of `earlier`, followed by that of `later`. */
export function product([ux, uy, uz, uw], [vx, vy, vz, vw]) {
  return [
    uw * vx + vw * ux + uy * vz - uz * vy,
    uw * vy + vw * uy + uz * vx - ux * vz,
    uw * vz + vw * uz + ux * vy - uy * vx,
    uw * vw - ux * vx - uy * vy - uz * vz,
  ];
}

function rotated([qx, qy, qz, qw], x, y, z) {
  const angle = Math.hypot(x, y, z);
  if (angle === 0) return [qx, qy, qz, qw];
  const scale = Math.sin(0.5 * angle) / angle;
  const c = Math.cos(0.5 * angle);
  const q = product([x * scale, y * scale, z * scale, c], [qx, qy, qz, qw]);
  const length = Math.hypot(...q);
  return q.map((part) => part / length);
}

/** Where the axes of a ball point that is turned by a quaternion: three vectors [x, y, z]. */
export function axesOf([x, y, z, w]) {
  return [
    [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)],
    [2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)],
    [2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)],
  ];
}
