// SPDX-License-Identifier: Apache-2.0
// The page: what the server tells is shown, what people do is asked for.

import { Aim } from "./aim.js";
import { Server, decoded, encoded } from "./link.js";
import { Turning, placeAt, product } from "./motion.js";
import { Balls, Effects, fillChoice, fillPaces } from "./panel.js";
import { Player } from "./player.js";
import { View, withFalls } from "./view.js";
import { ballName, ending, summary } from "./words.js";

const DRAG = 5; // px that a pointer moves before it drags
const TOUCH = 14; // px, radius within which a finger finds a ball
const FINE = Math.PI / 1800; // rad, of a key
const NOTICE = 4000; // ms that a refusal can be read, whatever is foreseen meanwhile

const $ = (selector) => document.querySelector(selector);
const canvas = $("#table");
const view = new View(canvas);
const state = { first: true, table: null, menu: null, preview: null, drag: null, dropped: null, turning: null };
state.rolling = false; // of a table that runs elsewhere
state.greets = false; // says how to begin, until somebody does
state.refused = -NOTICE; // when it was said why something cannot be, ms
const turns = {}; // how the balls were turned where the last run ended, by name

const server = new Server(heard, (up) => {
  document.body.classList.toggle("lost", !up);
  if (!up) say("The connection is lost. Trying again …", true);
});
const aim = new Aim($("#shot"), () => {
  state.greets = false;
  ask.preview();
  draw();
  remember();
});
const player = new Player($("#player"), draw, () => ask.preview());
const effects = new Effects($("#effects"), change, () => ask.preview());
const balls = new Balls($("#balls"), change, freePlace);

// ---- what the server tells

function heard(message) {
  if (message.tell === "menu") {
    state.menu = message;
    document.body.classList.toggle("live", message.live);
  }
  if (message.tell === "said") say(message.error, true);
  if (message.tell === "state") showState(message);
  if (message.tell === "happened") $("#happened").textContent = summary(message.run);
  if (message.tell !== "table") return;
  const { table, run } = message;
  const before = state.table;
  if (before) keepTurns();
  state.table = table;
  state.preview = null;
  view.show(table);
  aim.setLimit(table.miscue_limit);
  showPanel();
  if (run) {
    const shown = withFalls(run);
    state.turning = new Turning(shown, shown.names.map(turnOf));
    player.load(shown);
    $("#happened").textContent = summary(shown);
    remark("");
  } else if (!state.menu.live) {
    player.clear();
    $("#happened").textContent = "";
    if (before) remark("");
  }
  if (state.first) open(message.aim);
  else if (message.aim) aimAsGiven(message.aim);
  remember();
  ask.preview();
  draw();
}

// Of a table that runs elsewhere: where its balls are now.
function showState({ balls: places, at_rest: atRest }) {
  state.table.balls.forEach((ball, index) => {
    const place = places[index];
    ball.at = place && place.slice(0, 2);
    if (place) turns[ball.name] = product(place.slice(2), view.upright);
  });
  if (atRest !== !state.rolling) {
    state.rolling = !atRest;
    state.preview = null;
    remark("");
    ask.preview();
  }
  draw();
}

// The first table: the link in the address bar may hold another.
function open(given) {
  state.first = false;
  const link = decoded(location.hash.slice(1));
  aimAsGiven(link?.aim ?? given ?? {});
  // balls of a table that runs elsewhere are moved by nobody who opens a page
  const loaded = !state.menu.live && link?.scene && change({ do: "load", text: JSON.stringify(link.scene) });
  if (loaded) loaded.then(() => aimAsGiven(link.aim ?? given ?? {}));
  else greet();
}

function greet() {
  say(window.matchMedia("(hover: none)").matches
    ? "A finger on the cloth aims, the slider sets the speed. Balls can be dragged."
    : "Move the mouse to aim, turn its wheel for speed; Space shoots. A click holds the aim. Balls can be dragged.");
  state.greets = true;
}

// What a scene brings, or a guess where it brings none.
function aimAsGiven(given) {
  aim.setAll({ side: 0, up: 0, elevation: 0, ...(Object.keys(given).length ? given : firstAim()) });
}

// At the ball next to the foot spot.
function firstAim() {
  const [cue, ...others] = [cueBall(), ...state.table.balls.filter((ball) => ball.at && ball !== cueBall())];
  if (!cue || !others.length) return {};
  const foot = state.table.foot_spot;
  const away = (ball) => Math.hypot(ball.at[0] - foot[0], ball.at[1] - foot[1]);
  const nearest = others.reduce((one, other) => (away(other) < away(one) ? other : one));
  const azimuth = Math.atan2(nearest.at[1] - cue.at[1], nearest.at[0] - cue.at[0]);
  return { azimuth, speed: others.length > 5 ? 8 : 3 };
}

let remembering = 0;
function remember() {
  clearTimeout(remembering);
  remembering = setTimeout(() => {
    if (!state.table) return;
    history.replaceState(null, "", `#${encoded({ scene: state.table.link, aim: aim.values })}`);
  }, 200);
}

function showPanel() {
  const { table, menu } = state;
  fillChoice($("#scene"), menu.scenes, table.scene);
  fillChoice($("#preset-table"), menu.tables, table.table);
  fillChoice($("#preset-physics"), menu.physics, table.physics);
  if (menu.live) fillPaces($("#pace"), table.pace);
  effects.show(table.effects);
  balls.show(table.balls);
  $("#undo").disabled = !table.undo;
}

function say(text, bad = false) {
  const line = $("#said");
  line.textContent = text;
  line.classList.toggle("bad", bad);
}

// What nobody has asked for.
function remark(text) {
  if (performance.now() - state.refused >= NOTICE) say(text);
}

// ---- what is asked for

async function change(message) {
  state.greets = false;
  state.refused = -NOTICE;
  const answer = await server.ask(message);
  if (answer.error) {
    say(answer.error, true);
    state.refused = performance.now();
    showPanel();
    draw();
  }
  return answer;
}

// One preview at a time is under way; of those asked for meanwhile, the latest is next.
const ask = {
  busy: false,
  next: false,
  async preview() {
    if (!state.table || player.shows || state.rolling) return;
    if (!cueBall()) {
      remark("The cue ball is off the table: click where it is to lie.");
      return;
    }
    if (this.busy) {
      this.next = true;
      return;
    }
    this.busy = true;
    const revision = state.table.revision;
    const asked = shot();
    const answer = await server.ask({ do: "preview", shot: asked, without: effects.compared });
    this.busy = false;
    if (revision === state.table.revision && !answer.dropped && !state.rolling) this.show(asked, answer);
    if (this.next || revision !== state.table.revision) {
      this.next = false;
      this.preview();
    }
  },
  show(asked, answer) {
    state.preview = answer.error ? null : {
      shot: asked,
      run: withFalls(answer.run),
      without: answer.without ? withFalls(answer.without) : null,
    };
    if (answer.error) say(answer.error, true);
    else if (!player.shows && !state.greets) remark(foreseen(state.preview.run));
    draw();
  },
};

function foreseen(run) {
  const hit = run.events.find((event) => event.kind === "ball_ball");
  const fallen = run.events.filter((event) => event.kind === "pocketed").map((event) => event.balls[0]);
  const pocketed = fallen.filter((name) => name !== cueName());
  const parts = [hit ? `hits ${ballName(hit.balls.find((name) => name !== cueName()))} first` : "hits no ball"];
  if (pocketed.length) parts.push(`pockets ${pocketed.join(", ")}`);
  if (fallen.length > pocketed.length) parts.push("pockets the cue ball");
  parts.push(ending(run));
  return `This shot ${parts.join(", ")}.${compared()}`;
}

function compared() {
  const effect = state.table.effects.find((one) => one.key === effects.compared);
  const run = state.preview.without;
  if (!effect || !run) return "";
  const how = `${effect.on ? "without" : "with"} ${effect.label.toLowerCase()}`;
  return ` Dashed: ${how}, ${ending(run)}.`;
}

function shot() {
  return { ...aim.values, ball: cueName() };
}

function shoot() {
  if (player.shows) player.seek(player.run.end);
  else if (!cueBall()) say("The cue ball is off the table: click where it is to lie.", true);
  else change({ do: "shoot", shot: shot() });
}

function cueName() {
  const names = state.table.balls.map((ball) => ball.name);
  return names.includes("cue") ? "cue" : names[0];
}

function cueBall() {
  return state.table.balls.find((ball) => ball.name === cueName() && ball.at);
}

// Near the head spot for the cue ball, near the foot spot for others, further along the table where these are taken.
function freePlace(name) {
  const { head_spot, foot_spot, radius, rail, size } = state.table;
  const [spot, way] = name === cueName() ? [head_spot, -1] : [foot_spot, 1];
  const others = state.table.balls.filter((ball) => ball.at && ball.name !== name);
  const room = size[0] - 2 * radius;
  for (let step = 0; step * 0.25 * radius < room; step += 1) {
    const along = spot[0] - rail - radius + way * 0.25 * radius * step;
    const place = [rail + radius + ((along + room) % room), spot[1]];
    if (others.every((ball) => Math.hypot(ball.at[0] - place[0], ball.at[1] - place[1]) > 2.02 * radius)) return place;
  }
  return spot;
}

// ---- how balls are turned: a matter of this page

function turnOf(name) {
  return turns[name] ?? view.upright;
}

function keepTurns() {
  if (!player.run || !state.turning) return;
  player.run.names.forEach((name, index) => {
    turns[name] = state.turning.at(index, player.run.end);
  });
  state.turning = null;
}

// ---- drawing

let asked = false;
function draw() {
  if (asked) return;
  asked = true;
  requestAnimationFrame(() => {
    asked = false;
    if (state.table) drawNow();
  });
}

function drawNow() {
  const { table, preview } = state;
  view.clear();
  if (player.shows) {
    view.runAt(player.run, player.time, table.balls, state.turning);
    return;
  }
  const shown = preview && !state.drag;
  if (shown && preview.without) view.preview(preview.without, table.balls, { dashed: true });
  if (shown) view.preview(preview.run, table.balls);
  const turnAt = (index, name) => (state.turning ? state.turning.at(index, player.run.end) : turnOf(name));
  table.balls.forEach((ball, index) => {
    const moved = [state.drag, state.dropped].find((one) => one?.name === ball.name);
    const at = moved ? moved.at : ball.at;
    if (at) view.ball(at, ball, turnAt(index, ball.name));
  });
  const cue = cueBall();
  if (!cue || state.drag || state.rolling) return;
  if (shown) {
    const hit = preview.run.events.find((event) => event.kind === "ball_ball" && event.balls.includes(cue.name));
    const arcs = preview.run.arcs[preview.run.names.indexOf(cue.name)];
    if (hit) view.ghost(placeAt(arcs, hit.time, table.centre));
  }
  view.cue(cue.at, aim.values);
}

// ---- the mouse, fingers, keys

function ballUnder(event) {
  const place = view.under(event);
  const reach = Math.max(state.table.radius, event.pointerType === "touch" ? (TOUCH * view.ratio) / view.scale : 0);
  return state.table.balls.find((ball) => ball.at && Math.hypot(ball.at[0] - place[0], ball.at[1] - place[1]) <= reach);
}

function aimAt(event) {
  const cue = cueBall();
  const place = view.under(event);
  if (cue) aim.set("azimuth", Math.atan2(place[1] - cue.at[1], place[0] - cue.at[0]));
}

let down = null;
canvas.addEventListener("pointerdown", (event) => {
  if (!state.table || player.shows || event.button !== 0) return;
  canvas.setPointerCapture(event.pointerId);
  down = { x: event.clientX, y: event.clientY, ball: ballUnder(event) };
  if (!down.ball && event.pointerType === "touch") aimAt(event);
});
canvas.addEventListener("pointermove", (event) => {
  if (!state.table || player.shows) return;
  // keys are the table's again: else Space would press the last button once more
  if (document.activeElement.matches("button, select, summary, input:not([type=number])")) {
    canvas.focus({ preventScroll: true });
  }
  if (down?.ball) {
    if (!state.drag && Math.hypot(event.clientX - down.x, event.clientY - down.y) < DRAG) return;
    state.drag = { name: down.ball.name, at: view.under(event) };
    draw();
  } else if (event.pointerType === "touch" ? down : !aim.held) {
    aimAt(event);
  }
  canvas.style.cursor = ballUnder(event) ? "grab" : "crosshair";
});
canvas.addEventListener("pointerup", (event) => {
  const { drag } = state;
  if (drag) drop(drag);
  else if (down && !cueBall()) change({ do: "place", balls: { [cueName()]: view.under(event) } });
  else if (down?.ball) balls.choose(down.ball.name);
  else if (down && event.pointerType !== "touch") aim.setHeld(!aim.held);
  down = null;
  state.drag = null;
});
async function drop(drag) {
  const off = drag.at.some((value, axis) => value < state.table.outer[axis][0] || value > state.table.outer[axis][1]);
  balls.choose(drag.name);
  state.dropped = drag; // is shown there until the server has said whether it may lie there
  await change({ do: "place", balls: { [drag.name]: off ? null : drag.at } });
  if (state.dropped === drag) state.dropped = null;
  draw();
}
canvas.addEventListener("pointercancel", () => {
  down = null;
  state.drag = null;
  draw();
});
canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  const factor = Math.exp(-0.0012 * Math.max(Math.min(event.deltaY, 100), -100));
  aim.set("speed", Math.round(100 * aim.values.speed * factor) / 100);
}, { passive: false });

const KEYS = {
  " ": shoot,
  ArrowLeft: (event) => aim.set("azimuth", aim.values.azimuth + FINE * fineness(event)),
  ArrowRight: (event) => aim.set("azimuth", aim.values.azimuth - FINE * fineness(event)),
  ArrowUp: (event) => aim.set("speed", aim.values.speed + 0.1 * fineness(event)),
  ArrowDown: (event) => aim.set("speed", aim.values.speed - 0.1 * fineness(event)),
  h: () => aim.setHeld(!aim.held),
  p: () => (state.menu.live ? $("#pause").click() : player.toggle()),
  ",": () => player.step(-1),
  ".": () => (state.menu.live ? $("#tick").click() : player.step(1)),
  u: () => change({ do: "undo" }),
  z: (event) => (event.ctrlKey || event.metaKey) && change({ do: "undo" }),
};

function fineness(event) {
  return event.shiftKey ? 10 : event.altKey ? 0.1 : 1;
}

document.addEventListener("keydown", (event) => {
  if (!state.table || event.target.closest("input, select, textarea, dialog")) return;
  if (event.target.closest("button, summary, a") && [" ", "Enter"].includes(event.key)) return;
  const modified = event.ctrlKey || event.metaKey;
  if (!(event.key in KEYS) || (modified && event.key !== "z")) return;
  if (event.repeat && event.key === " ") return;
  event.preventDefault();
  KEYS[event.key](event);
});

// ---- buttons, files

$("#shoot").addEventListener("click", shoot);
$("#undo").addEventListener("click", () => change({ do: "undo" }));
$("#pause").addEventListener("click", async ({ target }) => {
  const on = target.getAttribute("aria-pressed") !== "true";
  const answer = await change({ do: "pause", on });
  if (!answer.error) target.setAttribute("aria-pressed", on);
});
$("#pace").addEventListener("change", ({ target }) => change({ do: "pace", factor: Number(target.value) }));
$("#tick").addEventListener("click", () => change({ do: "step" }));
$("#reset").addEventListener("click", () => change({ do: "reset" }));
for (const [selector, key] of [["#scene", "scene"], ["#preset-table", "table"], ["#preset-physics", "physics"]]) {
  $(selector).addEventListener("change", (event) => {
    if (event.target.value) change({ do: "set", [key]: event.target.value });
  });
}
$("#save").addEventListener("click", async () => {
  const answer = await change({ do: "save" });
  if (answer.error) return;
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([answer.text], { type: "application/yaml" }));
  link.download = `${answer.name}.yaml`;
  link.click();
  URL.revokeObjectURL(link.href);
});
$("#share").addEventListener("click", async () => {
  try {
    await navigator.clipboard.writeText(location.href);
    say("The link is on the clipboard: it holds this position and this aim.");
  } catch {
    say("The link in the address bar holds this position and this aim.");
  }
});
async function loadFile(file) {
  change({ do: "load", text: await file.text() });
}
$("#open").addEventListener("click", () => $("#file").click());
$("#file").addEventListener("change", (event) => {
  if (event.target.files[0]) loadFile(event.target.files[0]);
  event.target.value = "";
});
document.addEventListener("dragover", (event) => event.preventDefault());
document.addEventListener("drop", (event) => {
  event.preventDefault();
  if (event.dataTransfer.files[0]) loadFile(event.dataTransfer.files[0]);
});
$("#help").addEventListener("click", () => $("#keys").showModal());
new ResizeObserver(() => {
  if (!state.table) return;
  view.show(state.table);
  draw();
}).observe(canvas.parentElement);

// for whoever looks at the page from outside: tests, and the console
window.billiards = { state, aim, player, view, turns };
