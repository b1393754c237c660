// SPDX-License-Identifier: Apache-2.0
// What happened, in words.

const RAILS = { x_min: "head", x_max: "foot", y_min: "right", y_max: "left" };

/** The name of a ball in a sentence. */
export function ballName(name) {
  return /^\d+$/.test(name) ? `the ${name}` : name === "cue" ? "the cue ball" : name;
}

/** The name of a pocket: seen from the head, where x is low. */
export function pocketName(pocket) {
  const parts = pocket.match(/[xy]_(min|max)/g);
  if (parts.length === 1) return `${RAILS[parts[0]]} side pocket`;
  return `${RAILS[parts[0]]} ${RAILS[parts[1]]} corner`;
}

/** One event. */
export function told(event) {
  const [first, second] = event.balls.map(ballName);
  const speed = `${event.approach_speed.toPrecision(3)} m/s`;
  if (event.kind === "ball_ball") return `${first} and ${second} meet at ${speed}`;
  if (event.kind === "ball_rail") {
    const part = event.rail.match(/_(jaw|point)_/);
    if (!part) return `${first} hits the ${RAILS[event.rail]} cushion at ${speed}`;
    return `${first} hits a ${part[1]} of the ${pocketName(event.rail.split(part[0])[0])} at ${speed}`;
  }
  if (event.kind === "pocketed") return `${first} falls into the ${pocketName(event.pocket)}`;
  if (event.kind === "rolling") return `${first} begins to roll`;
  if (event.kind === "rest") return `${first} comes to rest`;
  return `${first} is struck`;
}

function counted(count, one, many) {
  return `${count} ${count === 1 ? one : many}`;
}

/** When a run comes to rest: at its `rest`, s, where it has one, else at its end; null where balls move on. */
export function ending({ end, rest = end }) {
  return rest === null ? `balls still move after ${end.toFixed(2)} s` : `at rest after ${rest.toFixed(2)} s`;
}

/** A run in a line: contacts, what is pocketed, the time to rest. */
export function summary(run) {
  const of = (kind) => run.events.filter((event) => event.kind === kind);
  const pocketed = of("pocketed").map((event) => event.balls[0]);
  const objects = pocketed.filter((name) => name !== "cue");
  const parts = [];
  if (objects.length) parts.push(`Pocketed: ${objects.join(", ")}`);
  if (pocketed.includes("cue")) parts.push("Scratch: the cue ball is pocketed");
  if (!pocketed.length) parts.push("Nothing pocketed");
  parts.push(counted(of("ball_ball").length, "contact of balls", "contacts of balls"));
  parts.push(counted(of("ball_rail").length, "of a cushion", "of cushions"));
  parts.push(ending(run));
  return `${parts.join(" · ")}.`;
}
