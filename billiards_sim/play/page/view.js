// SPDX-License-Identifier: Apache-2.0
// The table on a canvas: what lies still is drawn once, balls and lines anew whenever something changes.

import { drawBall, drawShadow } from "./balls.js";
import { pathUntil, placeAt } from "./motion.js";

const EDGE = 0.012; // m of the wood's outer edge beyond the rails
const CUE = { length: 1.47, tip: 0.0065, butt: 0.0145 }; // m; radii of its ends
const TURNED_BELOW = 0.95; // width to height of the place for the table, below which it stands upright
const FALL = 0.25; // s that a ball is seen to fall

export class View {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.still = document.createElement("canvas");
    this.table = null;
    this.turned = false;
    this.scale = 1;
    this.ratio = 1;
  }

  /** What is on: also measures the canvas, so call it after a change of size. */
  show(table) {
    this.table = table;
    const [x, y] = table.outer;
    this.low = [x[0] - EDGE, y[0] - EDGE];
    this.high = [x[1] + EDGE, y[1] + EDGE];
    const outer = [this.high[0] - this.low[0], this.high[1] - this.low[1]];
    const frame = this.canvas.parentElement.getBoundingClientRect();
    this.turned = frame.width / frame.height < TURNED_BELOW;
    const [across, up] = this.turned ? [outer[1], outer[0]] : outer;
    const scale = Math.min(frame.width / across, frame.height / up);
    this.ratio = Math.min(window.devicePixelRatio || 1, 3);
    this.scale = scale * this.ratio;
    this.canvas.style.width = `${across * scale}px`;
    this.canvas.style.height = `${up * scale}px`;
    this.canvas.width = Math.round(across * this.scale);
    this.canvas.height = Math.round(up * this.scale);
    this.drawStill();
  }

  /** A place of the table on the canvas. */
  at([x, y]) {
    return this.turned
      ? [(this.high[1] - y) * this.scale, (this.high[0] - x) * this.scale]
      : [(x - this.low[0]) * this.scale, (this.high[1] - y) * this.scale];
  }

  /** The place of the table under a pointer. */
  under(event) {
    const frame = this.canvas.getBoundingClientRect();
    const x = ((event.clientX - frame.left) * this.ratio) / this.scale;
    const y = ((event.clientY - frame.top) * this.ratio) / this.scale;
    return this.turned ? [this.high[0] - y, this.high[1] - x] : [x + this.low[0], this.high[1] - y];
  }

  /** Direction of the table on the canvas. */
  direction(x, y) {
    return this.turned ? [-y, -x] : [x, -y];
  }

  /** How a ball is turned whose number is to be read. */
  get upright() {
    return this.turned ? [0, 0, -Math.SQRT1_2, Math.SQRT1_2] : [0, 0, 0, 1];
  }

  get radius() {
    return this.table.radius * this.scale;
  }

  clear() {
    this.context.drawImage(this.still, 0, 0);
  }

  ball(place, ball, turn, alpha = 1, radius = this.radius) {
    const [x, y] = this.at(place);
    this.context.globalAlpha = alpha;
    if (alpha === 1) drawShadow(this.context, x, y, radius);
    drawBall(this.context, x, y, radius, ball, turn, (dx, dy) => this.direction(dx, dy));
    this.context.globalAlpha = 1;
  }

  /** The balls of a run at a time; those that fall are seen to. */
  runAt(run, time, balls, turning) {
    run.names.forEach((name, index) => {
      const place = placeAt(run.arcs[index], time, this.table.centre);
      if (!place) return;
      const fell = run.fallen[index];
      if (fell === undefined || time < fell) {
        this.ball(place, balls[index], turning.at(index, time));
      } else if (time - fell < FALL) {
        const share = (time - fell) / FALL;
        const from = placeAt(run.arcs[index], fell - 1e-9, this.table.centre);
        const sunk = [from[0] + share * (place[0] - from[0]), from[1] + share * (place[1] - from[1])];
        this.ball(sunk, balls[index], turning.at(index, fell - 1e-9), 1 - share, this.radius * (1 - 0.25 * share));
      }
    });
  }

  /** Paths of a preview, and where balls end. `style`: {dashed, alpha}. */
  preview(run, balls, { dashed = false, alpha = 0.9 } = {}) {
    const { context } = this;
    run.names.forEach((name, index) => {
      const end = run.fallen[index] ?? run.end;
      const points = pathUntil(run.arcs[index], end, this.table.centre);
      if (points.length < 2) return;
      context.globalAlpha = alpha;
      context.lineWidth = Math.max(1.8 * this.ratio, 0.1 * this.radius);
      context.setLineDash(dashed ? [5 * this.ratio, 5 * this.ratio] : []);
      context.lineJoin = "round";
      // brighter than the ball, on a pale line, so that dark colours are seen on the cloth
      const bright = mixed(balls[index].colour, "#ffffff", 0.25);
      for (const [colour, wider] of [["rgba(255, 255, 255, 0.4)", 1.6 * this.ratio], [bright, 0]]) {
        context.strokeStyle = colour;
        context.lineWidth += wider;
        this.line(points);
        context.lineWidth -= wider;
      }
      context.setLineDash([]);
      const last = points[points.length - 1];
      if (run.fallen[index] === undefined) {
        this.ring(last, this.radius, balls[index].colour, dashed ? 0.1 : 0.45);
      } else {
        this.ring(last, 0.55 * this.radius, balls[index].colour, dashed ? 0.2 : 1);
      }
      context.globalAlpha = 1;
    });
  }

  /** A line through places. */
  line(places) {
    this.context.beginPath();
    for (const place of places) this.context.lineTo(...this.at(place));
    this.context.stroke();
  }

  /** An outlined disc; `fill` is how much is seen of its inside. */
  ring(place, radius, colour, fill) {
    const { context } = this;
    const alpha = context.globalAlpha;
    context.beginPath();
    context.arc(...this.at(place), radius, 0, 2 * Math.PI);
    context.fillStyle = colour;
    context.globalAlpha = alpha * fill;
    context.fill();
    context.globalAlpha = alpha;
    context.strokeStyle = "rgba(255, 255, 255, 0.85)";
    context.lineWidth = 1.2 * this.ratio;
    context.stroke();
  }

  /** The ghost of the cue ball where it first hits another. */
  ghost(place) {
    this.context.setLineDash([3 * this.ratio, 3 * this.ratio]);
    this.ring(place, this.radius, "#ffffff", 0.25);
    this.context.setLineDash([]);
  }

  /** The cue behind a ball, drawn back by the speed; `aim` has azimuth, speed, side, elevation. */
  cue(place, aim) {
    const { context } = this;
    const along = [Math.cos(aim.azimuth), Math.sin(aim.azimuth)];
    const left = [-along[1], along[0]];
    const seen = Math.cos(aim.elevation); // from above
    const aside = aim.side * this.table.radius;
    const back = this.table.radius + 0.02 + 0.02 * aim.speed;
    const point = (away, out) => this.at([
      place[0] - away * seen * along[0] + (aside + out) * left[0],
      place[1] - away * seen * along[1] + (aside + out) * left[1],
    ]);
    const part = (from, to, colour) => {
      const thick = (share) => CUE.tip + (CUE.butt - CUE.tip) * share;
      const [a, b] = [from, to].map((share) => back + share * CUE.length);
      context.beginPath();
      context.moveTo(...point(a, thick(from)));
      context.lineTo(...point(b, thick(to)));
      context.lineTo(...point(b, -thick(to)));
      context.lineTo(...point(a, -thick(from)));
      context.closePath();
      context.fillStyle = colour;
      context.fill();
    };
    context.save();
    context.shadowColor = "rgba(0, 0, 0, 0.45)";
    context.shadowBlur = 6 * this.ratio;
    context.shadowOffsetX = context.shadowOffsetY = 4 * this.ratio;
    part(0, 1, "#d9b380");
    context.restore();
    part(0.62, 1, "#3b2416");
    part(0.62, 0.63, "#c9a24b");
    part(0, 0.016, "#f3efe6");
    part(0, 0.006, "#2f6fb0");
  }

  drawStill() {
    const { table, scale } = this;
    const { width, height } = this.canvas;
    this.still.width = width;
    this.still.height = height;
    const context = this.still.getContext("2d");
    const { cloth, rubber, wood, hole, marking } = table.colours;
    const fill = (places, colour) => {
      context.beginPath();
      for (const place of places) context.lineTo(...this.at(place));
      context.closePath();
      context.fillStyle = colour;
      context.fill();
    };
    const dot = (place, radius, colour) => {
      context.beginPath();
      context.arc(...this.at(place), radius * scale, 0, 2 * Math.PI);
      context.fillStyle = colour;
      context.fill();
    };
    const grain = context.createLinearGradient(0, 0, 0, height);
    grain.addColorStop(0, mixed(wood, "#ffffff", 0.16));
    grain.addColorStop(0.5, wood);
    grain.addColorStop(1, mixed(wood, "#000000", 0.3));
    context.beginPath();
    context.roundRect(0, 0, width, height, Math.max(0.35 * table.rail, 0.03) * scale);
    context.fillStyle = grain;
    context.fill();
    const [x, y, reach] = [width / 2, height / 2, 0.6 * Math.max(width, height)];
    const light = context.createRadialGradient(x, y, 0, x, y, reach);
    light.addColorStop(0, mixed(cloth, "#ffffff", 0.09));
    light.addColorStop(1, mixed(cloth, "#000000", 0.16));
    fill(table.cloth, light);
    const chalk = "rgba(255, 255, 255, 0.45)";
    for (const line of table.lines) {
      context.beginPath();
      for (const place of line) context.lineTo(...this.at(place));
      context.strokeStyle = chalk;
      context.lineWidth = 0.004 * scale;
      context.stroke();
    }
    for (const spot of table.spots) dot(spot, 0.006, chalk);
    context.lineJoin = "round";
    for (const places of table.holes) {
      fill(places, hole);
      context.strokeStyle = "#17120f"; // leather
      context.lineWidth = 0.014 * scale;
      context.stroke();
    }
    context.save();
    context.shadowColor = "rgba(0, 0, 0, 0.55)";
    context.shadowBlur = 0.02 * scale;
    for (const cushion of table.cushions) fill(cushion, rubber);
    context.restore();
    for (const cushion of table.cushions) {
      fill(cushion, rubber);
      context.strokeStyle = mixed(cloth, "#ffffff", 0.2);
      context.lineWidth = this.ratio;
      context.stroke();
    }
    for (const sight of table.sights) dot(sight, Math.min(0.006, 0.1 * table.rail), marking);
  }
}

function mixed(colour, other, share) {
  const parts = (text) => [1, 3, 5].map((from) => parseInt(text.slice(from, from + 2), 16));
  const [from, to] = [parts(colour), parts(other)];
  return `rgb(${from.map((part, index) => Math.round(part + share * (to[index] - part))).join(", ")})`;
}

/** Make what a run has not but is drawn: when each ball fell, by index. */
export function withFalls(run) {
  const fallen = {};
  for (const event of run.events) if (event.kind === "pocketed") fallen[run.names.indexOf(event.balls[0])] = event.time;
  return { ...run, fallen };
}
