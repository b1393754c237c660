// SPDX-License-Identifier: Apache-2.0
// The choices beside the table: scene, table, physics, effects, balls.

const NAMES = {
  eight_ball: "Eight-ball",
  nine_ball: "Nine-ball",
  ten_ball: "Ten-ball",
  straight_pool: "Straight pool (14.1)",
  snooker: "Snooker",
  three_cushion: "Three-cushion",
  rack: "Rack on the paper's table",
  head_on: "Two balls, head on",
  glancing: "Two balls, glancing",
  random_balls: "Twenty balls at random",
  pool_9ft: "Pool, 9 ft",
  pool_8ft: "Pool, 8 ft",
  pool_7ft: "Pool, 7 ft",
  snooker_12ft: "Snooker, 12 ft",
  carom_10ft: "Carom, 10 ft",
  pool: "Pool",
  carom: "Carom",
  paper: "The paper's",
};
const PACES = [0.05, 0.25, 1, 2, 4];

/** Fill the choice of how fast a table that runs elsewhere runs. */
export function fillPaces(select, pace) {
  const paces = PACES.includes(pace) ? PACES : [...PACES, pace].sort((one, other) => one - other);
  select.replaceChildren(...paces.map((value) => {
    const words = value < 1 ? `1/${Number((1 / value).toPrecision(3))}` : value;
    return element("option", { value }, `${words}×`);
  }));
  select.value = pace;
}

function element(kind, attributes = {}, ...children) {
  const made = document.createElement(kind);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...children);
  return made;
}

/** Fill a choice; `key` of the message that is asked for is the name of the choice. */
export function fillChoice(select, values, chosen) {
  const options = values.map((value) => element("option", { value }, NAMES[value] ?? value));
  if (!values.includes(chosen)) options.unshift(element("option", { value: "" }, chosen || "changed"));
  select.replaceChildren(...options);
  select.value = values.includes(chosen) ? chosen : "";
}

/** The switches of effects. `ask` takes messages, `compare` the effect that a second preview goes without, or null. */
export class Effects {
  constructor(root, ask, compare) {
    this.root = root;
    this.ask = ask;
    this.compare = compare;
    this.compared = null;
    this.rows = new Map();
  }

  show(effects) {
    if (this.rows.size !== effects.length) {
      this.rows = new Map(effects.map((effect) => [effect.key, this.row(effect)]));
      this.root.replaceChildren(...[...this.rows.values()].map((row) => row.item));
    }
    for (const effect of effects) {
      const { toggle, figure } = this.rows.get(effect.key);
      toggle.checked = effect.on;
      figure.disabled = !effect.on;
      if (figure !== document.activeElement) figure.value = Number((effect.value / effect.scale).toPrecision(5));
    }
  }

  row({ key, label, help, unit, scale }) {
    const toggle = element("input", { type: "checkbox", role: "switch", id: `effect-${key}` });
    const figure = element("input", { type: "number", step: "any", "aria-label": `${label}, figure ${unit}` });
    const compare = element("button", {
      type: "button", class: "small", "aria-pressed": "false",
      title: `Draw the shot with and without: ${label}`, "aria-label": `Compare with and without: ${label}`,
    }, "Compare");
    toggle.addEventListener("change", () => this.ask({ do: "effect", effect: key, on: toggle.checked }));
    figure.addEventListener("change", () => {
      if (figure.value.trim() === "") return;
      this.ask({ do: "effect", effect: key, on: true, value: Number(figure.value) * scale });
    });
    compare.addEventListener("click", () => this.setCompared(this.compared === key ? null : key));
    const item = element(
      "li", { title: help },
      element("label", { class: "switch", for: `effect-${key}` }, toggle, element("span", { class: "knob" }), label),
      element("span", { class: "figure" }, figure, element("span", { class: "unit" }, unit)),
      compare,
    );
    return { item, toggle, figure, compare };
  }

  setCompared(key) {
    this.compared = key;
    for (const [other, { compare }] of this.rows) compare.setAttribute("aria-pressed", other === key);
    this.compare(key);
  }
}

/** The balls as a row of buttons, and the place of the one that is chosen. */
export class Balls {
  constructor(root, ask, freePlace) {
    this.ask = ask;
    this.freePlace = freePlace;
    this.chosen = null;
    this.balls = [];
    this.chips = root.querySelector("[data-chips]");
    this.off = root.querySelector("[data-off]");
    this.fields = [...root.querySelectorAll("[data-place]")];
    this.chips.addEventListener("click", (event) => {
      const name = event.target.closest("button")?.dataset.ball;
      if (name) this.choose(name);
    });
    this.off.addEventListener("click", () => this.toggle());
    this.fields.forEach((field, axis) => field.addEventListener("change", () => this.move(axis)));
  }

  show(balls) {
    this.balls = balls;
    if (!balls.some((ball) => ball.name === this.chosen)) this.chosen = balls[0].name;
    const focused = document.activeElement?.dataset?.ball;
    this.chips.replaceChildren(...balls.map((ball) => {
      const chip = element("button", {
        type: "button", class: "chip", "data-ball": ball.name, "aria-pressed": ball.name === this.chosen,
        "aria-label": `Ball ${ball.name}${ball.at ? "" : ", off the table"}`,
        title: ball.name,
      }, ball.name.match(/\d+$/)?.[0].slice(-3) ?? "");
      chip.style.setProperty("--ball", ball.colour);
      if (ball.striped) chip.classList.add("striped");
      if (!ball.at) chip.classList.add("off");
      return chip;
    }));
    if (focused) this.chips.querySelector(`[data-ball="${CSS.escape(focused)}"]`)?.focus();
    const ball = this.ball;
    this.off.textContent = ball.at ? `Take ${ball.name} off` : `Put ${ball.name} back`;
    this.fields.forEach((field, axis) => {
      field.disabled = !ball.at;
      if (field !== document.activeElement) field.value = ball.at ? Number(ball.at[axis].toFixed(4)) : "";
    });
  }

  get ball() {
    return this.balls.find((ball) => ball.name === this.chosen);
  }

  choose(name) {
    this.chosen = name;
    this.show(this.balls);
  }

  toggle() {
    const { name, at } = this.ball;
    this.ask({ do: "place", balls: { [name]: at ? null : this.freePlace(name) } });
  }

  move(axis) {
    const place = [...this.ball.at]; // what is shown is rounded
    place[axis] = Number(this.fields[axis].value);
    if (this.fields[axis].value.trim() !== "") this.ask({ do: "place", balls: { [this.chosen]: place } });
  }
}
