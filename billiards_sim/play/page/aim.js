// SPDX-License-Identifier: Apache-2.0
// What the shot will be: fields, sliders and the picture of the cue ball, all of the same figures.

const DEGREE = Math.PI / 180;
const FIELDS = {
  speed: { scale: 1, digits: 2, low: 0.05, high: 15 },
  azimuth: { scale: DEGREE, digits: 2 },
  side: { scale: 1, digits: 3 },
  up: { scale: 1, digits: 3 },
  elevation: { scale: DEGREE, digits: 1, low: 0, high: 89 * DEGREE },
};
const NUDGE = 0.02; // radii, of a key on the picture

export class Aim {
  /** `root` holds the controls, `changed` is called whenever a figure changes. */
  constructor(root, changed) {
    this.changed = changed;
    this.values = { speed: 3, azimuth: 0, side: 0, up: 0, elevation: 0 };
    this.limit = 1; // of the tip, in radii
    this.held = false; // whether the mouse leaves the angle alone
    this.inputs = [...root.querySelectorAll("[data-aim]")];
    for (const input of this.inputs) {
      input.addEventListener("input", () => {
        const value = input.value.trim() === "" ? NaN : Number(input.value);
        if (Number.isFinite(value)) this.set(input.dataset.aim, value * FIELDS[input.dataset.aim].scale, input);
      });
      input.addEventListener("change", () => this.show());
    }
    this.tip = root.querySelector("[data-tip]");
    this.dot = this.tip.querySelector("[data-dot]");
    this.ring = this.tip.querySelector("[data-limit]");
    for (const kind of ["pointerdown", "pointermove"]) this.tip.addEventListener(kind, (event) => this.point(event));
    this.tip.addEventListener("dblclick", () => this.setTip(0, 0));
    this.tip.addEventListener("keydown", (event) => this.nudge(event));
    this.hold = root.querySelector("[data-hold]");
    this.hold.addEventListener("click", () => this.setHeld(!this.held));
    this.show();
  }

  set(name, value, from = null) {
    const { low = -Infinity, high = Infinity } = FIELDS[name];
    this.values[name] = Math.min(Math.max(value, low), high);
    this.show(from);
    this.changed();
  }

  setAll(values) {
    for (const name of Object.keys(FIELDS)) if (Number.isFinite(values[name])) this.values[name] = values[name];
    this.show();
    this.changed();
  }

  setHeld(held) {
    this.held = held;
    this.hold.setAttribute("aria-pressed", held);
  }

  /** The tip must stay this near the middle of the ball, in radii. */
  setLimit(limit) {
    this.limit = limit;
    this.ring.setAttribute("r", limit);
  }

  setTip(side, up) {
    const size = Math.hypot(side, up);
    const most = 0.999 * this.limit;
    const share = size > most ? most / size : 1;
    const whole = (value) => Math.round(1000 * value * share) / 1000;
    Object.assign(this.values, { side: whole(side), up: whole(up) });
    this.show();
    this.changed();
  }

  point(event) {
    if (event.type === "pointerdown") this.tip.setPointerCapture(event.pointerId);
    else if (!this.tip.hasPointerCapture(event.pointerId)) return;
    const frame = this.tip.getBoundingClientRect();
    const across = (2.2 * (event.clientX - frame.left)) / frame.width - 1.1;
    const down = (2.2 * (event.clientY - frame.top)) / frame.height - 1.1;
    this.setTip(-across, -down);
  }

  nudge(event) {
    const way = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (event.key === "Home") this.setTip(0, 0);
    else if (way) this.setTip(this.values.side + NUDGE * way[0], this.values.up + NUDGE * way[1]);
    else return;
    event.preventDefault();
    event.stopPropagation();
  }

  show(except = null) {
    for (const input of this.inputs) {
      const { scale, digits } = FIELDS[input.dataset.aim];
      if (input !== except) input.value = Number((this.values[input.dataset.aim] / scale).toFixed(digits));
    }
    const { side, up } = this.values;
    this.dot.setAttribute("cx", -side);
    this.dot.setAttribute("cy", -up);
    const words = [];
    if (up) words.push(`${Math.abs(up).toFixed(2)} ${up > 0 ? "above" : "below"}`);
    if (side) words.push(`${Math.abs(side).toFixed(2)} ${side > 0 ? "left" : "right"}`);
    this.tip.setAttribute("aria-valuetext", words.length ? `${words.join(", ")}, in radii` : "centre");
  }
}
