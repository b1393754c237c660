// SPDX-License-Identifier: Apache-2.0
// A run in a file of its own: what the page does with a run, without a server.

import { Turning, restOf } from "./motion.js";
import { Player } from "./player.js";
import { View, withFalls } from "./view.js";
import { summary } from "./words.js";

const { table, run, title } = JSON.parse(document.querySelector("#run").textContent);
const shown = withFalls(run);
const scene = new View(document.querySelector("#table"));
scene.show(table);
const turning = new Turning(shown, shown.names.map(() => scene.upright));
const playback = new Player(document.querySelector("#player"), () => {
  scene.clear();
  scene.runAt(shown, playback.time, table.balls, turning);
});
document.title = title;
document.querySelector("#said").textContent = title;
document.querySelector("#happened").textContent = summary({ ...shown, rest: restOf(run) });
playback.load(shown, false);
document.addEventListener("keydown", (event) => {
  const keys = { " ": () => playback.toggle(), ",": () => playback.step(-1), ".": () => playback.step(1) };
  if (!(event.key in keys) || event.target.closest("button, select, summary")) return;
  event.preventDefault();
  keys[event.key]();
});
new ResizeObserver(() => {
  scene.show(table);
  playback.draw();
}).observe(document.querySelector(".felt"));
window.billiards = { playback, turning, table, view: scene };
