// SPDX-License-Identifier: Apache-2.0
// Plays a run: real time, faster, slower, paused, tick by tick, and to and fro along its time line.

import { told } from "./words.js";

const TICK = 0.01; // s, of a step
const SHOWN = ["ball_ball", "ball_rail", "pocketed"]; // events along the time line
const LONGEST_FRAME = 0.1; // s; a page that was hidden goes on where it was

export class Player {
  /** `root` holds the controls; `draw` is called whenever the time changes, `ended` when it is that of the end. */
  constructor(root, draw, ended = () => {}) {
    this.draw = draw;
    this.ended = ended;
    this.run = null;
    this.time = 0;
    this.playing = false;
    this.before = null;
    const find = (name) => root.querySelector(`[data-player="${name}"]`);
    [this.button, this.line, this.clock, this.rate, this.marks, this.list] = [
      "play", "line", "clock", "rate", "marks", "events",
    ].map(find);
    this.button.addEventListener("click", () => this.toggle());
    find("start").addEventListener("click", () => this.seek(0));
    find("end").addEventListener("click", () => this.seek(this.run ? this.run.end : 0));
    find("back").addEventListener("click", () => this.step(-1));
    find("step").addEventListener("click", () => this.step(1));
    this.line.addEventListener("input", () => this.seek(Number(this.line.value)));
    this.list.addEventListener("click", (event) => {
      const at = event.target.closest("button")?.dataset.time;
      if (at !== undefined) this.seek(Number(at));
    });
    this.controls = [...root.querySelectorAll("button[data-player], input[data-player]")];
    this.clear();
  }

  /** Whether a run is on that has not come to its end. */
  get shows() {
    return this.run !== null && this.time < this.run.end;
  }

  load(run, playing = true) {
    this.run = run;
    this.enable(true);
    this.line.max = run.end;
    this.line.step = "any";
    this.showEvents();
    this.time = 0;
    this.seek(0);
    this.setPlaying(playing);
  }

  clear() {
    this.run = null;
    this.setPlaying(false);
    this.enable(false);
    this.line.value = 0;
    this.clock.textContent = "0.00 s";
    this.marks.replaceChildren();
    this.list.replaceChildren();
  }

  enable(enabled) {
    for (const control of this.controls) control.disabled = !enabled;
  }

  toggle() {
    if (!this.run) return;
    if (!this.playing && this.time >= this.run.end) this.time = 0;
    this.setPlaying(!this.playing);
  }

  seek(time) {
    if (!this.run) return;
    this.setPlaying(false);
    this.setTime(time);
  }

  step(count) {
    if (this.run) this.seek(Math.min(Math.max(TICK * (Math.round(this.time / TICK) + count), 0), this.run.end));
  }

  setTime(time) {
    this.time = Math.min(time, this.run.end);
    this.line.value = this.time;
    this.line.setAttribute("aria-valuetext", `${this.time.toFixed(2)} seconds`);
    this.clock.textContent = `${this.time.toFixed(2)} / ${this.run.end.toFixed(2)} s`;
    this.draw();
    if (!this.shows) this.ended();
  }

  setPlaying(playing) {
    this.playing = playing;
    this.before = null;
    this.button.setAttribute("aria-label", playing ? "Pause" : "Play");
    this.button.dataset.playing = playing;
    if (playing) requestAnimationFrame((now) => this.frame(now));
  }

  frame(now) {
    if (!this.playing) return;
    const passed = this.before === null ? 0 : Math.min((now - this.before) / 1000, LONGEST_FRAME);
    this.before = now;
    this.setTime(this.time + passed * Number(this.rate.value));
    if (this.time >= this.run.end) {
      this.setPlaying(false);
    } else {
      requestAnimationFrame((next) => this.frame(next));
    }
  }

  showEvents() {
    const { end, events } = this.run;
    const shown = events.filter((event) => SHOWN.includes(event.kind));
    this.marks.replaceChildren(...shown.map((event) => {
      const mark = document.createElementNS("http://www.w3.org/2000/svg", "line");
      const at = end > 0 ? (100 * event.time) / end : 0;
      mark.setAttribute("x1", at);
      mark.setAttribute("x2", at);
      mark.setAttribute("y1", event.kind === "pocketed" ? 0 : 5);
      mark.setAttribute("y2", 10);
      mark.setAttribute("class", event.kind);
      return mark;
    }));
    this.list.replaceChildren(...shown.map((event) => {
      const item = document.createElement("li");
      const button = document.createElement("button");
      button.type = "button";
      button.dataset.time = event.time;
      button.className = event.kind;
      const time = document.createElement("time");
      time.textContent = `${event.time.toFixed(4)} s`;
      button.append(time, ` ${told(event)}`);
      item.append(button);
      return item;
    }));
  }
}
