// SPDX-License-Identifier: Apache-2.0
// A ball from above, painted and turned: z of its own frame goes through its numbers, y is the axis of its stripe.

import { axesOf } from "./motion.js";

const STRIPE = 0.5; // half the width of a stripe, in radii
const DISC = 0.42; // radius of the disc under a number
const SPOT = 0.2; // radius of the spots of a ball without a number
const WHITE = "#faf7f0";
const INK = "#14110f";
const SMALLEST_NUMBER = 7; // px, radius of a ball below which no number is drawn

/** Draw a ball at a place on the screen; `toScreen` takes directions of the table there. */
export function drawBall(context, x, y, radius, ball, turn, toScreen) {
  context.save();
  context.translate(x, y);
  context.scale(radius, radius);
  context.beginPath();
  context.arc(0, 0, 1, 0, 2 * Math.PI);
  context.fillStyle = ball.colour;
  context.fill();
  context.clip();
  const axes = axesOf(turn).map(([ax, ay, az]) => [...toScreen(ax, ay), az]);
  if (ball.striped) for (const sign of [1, -1]) paintCap(context, scaled(axes[1], sign), STRIPE, WHITE);
  const numbered = /^\d+$/.test(ball.name);
  if (numbered) for (const sign of [1, -1]) paintNumber(context, axes, sign, ball.name, radius);
  else paintSpots(context, axes, ball);
  paintShade(context);
  context.restore();
}

/** The shadow that a ball casts on the cloth. */
export function drawShadow(context, x, y, radius) {
  const shift = 0.28 * radius;
  const shade = context.createRadialGradient(x + shift, y + shift, 0.5 * radius, x + shift, y + shift, 1.25 * radius);
  shade.addColorStop(0, "rgba(0, 0, 0, 0.55)");
  shade.addColorStop(1, "rgba(0, 0, 0, 0)");
  context.fillStyle = shade;
  context.beginPath();
  context.arc(x + shift, y + shift, 1.25 * radius, 0, 2 * Math.PI);
  context.fill();
}

function scaled([x, y, z], factor) {
  return [factor * x, factor * y, factor * z];
}

function paintSpots(context, axes, ball) {
  const colour = ball.name === "cue" ? "#c01c1c" : "rgba(255, 255, 255, 0.55)";
  for (const axis of axes) {
    for (const sign of [1, -1]) paintCap(context, scaled(axis, sign), Math.sqrt(1 - SPOT * SPOT), colour);
  }
}

function paintNumber(context, [across, up, pole], sign, name, radius) {
  const axis = scaled(pole, sign);
  paintCap(context, axis, Math.sqrt(1 - DISC * DISC), WHITE);
  if (axis[2] < 0.15 || radius < SMALLEST_NUMBER) return;
  const height = Math.sqrt(1 - DISC * DISC);
  context.save();
  context.transform(across[0], across[1], -sign * up[0], -sign * up[1], height * axis[0], height * axis[1]);
  context.scale(0.01, 0.01); // fonts below a pixel are not drawn
  context.fillStyle = INK;
  context.font = `bold ${name.length > 1 ? 50 : 60}px system-ui, sans-serif`;
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillText(name, 0, 4);
  context.restore();
}

// What is seen of the part of a unit sphere where n . axis > height: bounded by the visible part of its circle, and by
// the outline of the ball where the circle goes behind it.
function paintCap(context, [x, y, z], height, colour) {
  const flat = Math.hypot(x, y);
  const width = Math.sqrt(1 - height * height);
  const edge = flat < 1e-9 ? -Math.sign(z) : (-height * z) / (width * flat);
  if (edge >= 1) return; // behind
  const half = Math.acos(Math.max(edge, -1));
  const [cos, sin] = flat < 1e-9 ? [1, 0] : [x / flat, y / flat];
  context.beginPath();
  for (let step = 0; step <= 32; step += 1) {
    const angle = half * (step / 16 - 1);
    const along = height * flat - width * Math.cos(angle) * z;
    const aside = width * Math.sin(angle);
    context.lineTo(along * cos - aside * sin, along * sin + aside * cos);
  }
  if (edge > -1) {
    const middle = Math.atan2(y, x);
    const reach = Math.acos(Math.min(height / flat, 1));
    context.arc(0, 0, 1, middle + reach, middle - reach, true);
  }
  context.fillStyle = colour;
  context.fill();
}

function paintShade(context) {
  const shade = context.createRadialGradient(-0.35, -0.4, 0.05, 0, 0, 1);
  shade.addColorStop(0, "rgba(255, 255, 255, 0.55)");
  shade.addColorStop(0.18, "rgba(255, 255, 255, 0.12)");
  shade.addColorStop(0.6, "rgba(0, 0, 0, 0.06)");
  shade.addColorStop(1, "rgba(0, 0, 0, 0.5)");
  context.fillStyle = shade;
  context.fillRect(-1, -1, 2, 2);
}
