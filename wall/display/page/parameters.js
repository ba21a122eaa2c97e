// The panel of parameters: a row for each that the run offers, with sliders and colours; values follow others' edits.

const TRUST_MS = 700;             // a control that was just moved shows its own value until the run says it
const STOPS_BELOW = 8, STOPS_ABOVE = 6;   // of a strength slider, about the configured value; its left end is the least
const SOFT = { exposure: [-8, 8] };       // what the slider spans where the range is wider than anyone needs
const WIDEST = 1000;              // a range above is spanned by stops
const SCENES_AWAY = 1e4;          // radii of the scene that an object may be moved; its sliders span one
const DEGREES = 180 / Math.PI;
const DECIMAL = /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i;
const SRGB = /^#[0-9a-f]{6}$/i;
const AXES = ["x", "y", "z"];

const clamp = (x, low, high) => Math.min(high, Math.max(low, x));
const short = (x) => String(Number(x.toPrecision(3)));
const exact = (numbers) => numbers.map((x) => Number(x.toPrecision(6))).join(" ");
const encoded = (x) => (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055);
const decoded = (x) => (x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4);

// The numbers of a text, with spaces or commas between and perhaps the unit behind them; [] for any other text.
function numbersIn(text, unit) {
  const whole = text.replaceAll("\u2212", "-").trim();
  const bare = unit && whole.endsWith(unit) ? whole.slice(0, -unit.length).trim() : whole;
  const parts = bare.split(/\s*,\s*|\s+/);
  return parts.every((part) => DECIMAL.test(part)) ? parts.map(Number) : [];
}

export const hexOf = (rgb) => "#" + rgb
  .map((x) => Math.round(255 * encoded(clamp(x, 0, 1))).toString(16).padStart(2, "0")).join("");
export const rgbOf = (hex) => [1, 3, 5].map((k) => decoded(parseInt(hex.slice(k, k + 2), 16) / 255));

export class Parameters {
  #panel; #groups; #send; #rows = new Map(); #names = ""; #due = new Map(); #all = []; #said = []; #object; #later;

  // `send` takes a command: `set` with a name and numbers, or null for what is configured.
  constructor(panel, groups, send) {
    this.#panel = panel;
    this.#groups = groups;
    this.#send = send;
  }

  show(parameters) {
    this.#all = parameters;
    this.#panel.hidden = parameters.length === 0;
    const shown = parameters.filter(({ name }) => this.#shows(name)), names = shown.map((p) => p.name).join("\n");
    if (names !== this.#names) this.#build(shown, names);
    this.#said = shown;
    this.#follow();
  }

  // Of objects, show the parameters of the one that is selected in the steered view.
  select(object) {
    if (object === this.#object) return;
    this.#object = object;
    this.show(this.#all);
  }

  #shows(name) {
    return !name.startsWith("objects.") || name.slice("objects.".length, name.lastIndexOf(".")) === this.#object;
  }

  // What the run said last, in every row; one that was just moved follows later, for the run says a change only once.
  #follow() {
    clearTimeout(this.#later);
    const now = performance.now();
    let wait = Infinity;
    for (const parameter of this.#said) {
      const row = this.#rows.get(parameter.name), trusted = row.asked + TRUST_MS - now;
      if (trusted > 0) wait = Math.min(wait, trusted);
      else row.take(parameter.value);
    }
    if (wait < Infinity) this.#later = setTimeout(() => this.#follow(), wait);
  }

  #build(parameters, names) {
    this.#names = names;
    this.#rows.clear();
    const groups = new Map();
    for (const parameter of parameters) {
      const [title, label] = titled(parameter.name);
      if (!groups.has(title)) groups.set(title, group(title));
      const row = new Row(parameter, label, (numbers) => this.#set(parameter.name, numbers));
      this.#rows.set(parameter.name, row);
      groups.get(title).append(row.element);
    }
    this.#groups.replaceChildren(...[...groups.values()].map((rows) => rows.parentElement));
    if (parameters[0]?.name.startsWith("objects.")) this.#groups.scrollTop = 0;   // just selected: its own come first
  }

  // Hide the object that is selected, or show it again.
  toggleObject() {
    const found = this.#said.find(({ name }) => name.startsWith("objects.") && name.endsWith(".visible"));
    if (found) this.#send({ kind: "set", name: found.name, numbers: found.value[0] ? [0] : null });
  }

  // At most one command an animation frame for each parameter, the newest.
  #set(name, numbers) {
    this.#rows.get(name).asked = performance.now();
    if (!this.#due.size) requestAnimationFrame(() => this.#flush());
    this.#due.set(name, numbers);
  }

  #flush() {
    for (const [name, numbers] of this.#due) this.#send({ kind: "set", name, numbers });
    this.#due.clear();
  }
}

// Group and label of a name path; a material's name may have dots.
function titled(name) {
  const first = name.indexOf("."), last = name.lastIndexOf(".");
  if (first < 0) return ["Picture", name];
  const head = name.slice(0, first), label = name.slice(last + 1);
  if (head === "lights") return [`Light ${name.slice(first + 1, last)}`, label];
  if (head === "cuts") return [`Cut ${name.slice(first + 1, last)}`, label];
  if (head === "objects") return [`Object ${name.slice(first + 1, last)}`, label];
  if (head === "nodes") return [`Image ${name.slice(first + 1, last)}`, label];
  if (head === "materials") return [name.slice(first + 1, last), label];
  return [head[0].toUpperCase() + head.slice(1), label];
}

function group(title) {
  const section = document.createElement("section");
  const rows = document.createElement("div");
  section.append(Object.assign(document.createElement("h3"), { textContent: title }), rows);
  return rows;
}

class Row {
  asked = -Infinity;
  element = document.createElement("div");
  #value; #parameter; #controls; #shown; #reset; #set;

  constructor(parameter, label, set) {
    this.#parameter = parameter;
    this.element.className = "parameter";
    this.element.dataset.name = parameter.name;
    this.element.dataset.kind = parameter.kind;
    const text = parameter.kind === "choice" ? label.replaceAll("_", " ") : label;
    const name = Object.assign(document.createElement("span"), { textContent: text, title: parameter.name });
    this.#shown = this.#typed() ? this.#field() : document.createElement("output");
    this.#reset = Object.assign(document.createElement("button"), { type: "button", textContent: "↺" });
    this.#reset.setAttribute("aria-label", `${parameter.name}: as configured`);
    this.#reset.title = "As configured";
    this.#reset.onclick = () => { this.take(parameter.default); set(null); };
    const change = (numbers) => { this.#label(numbers); this.#value = numbers; set(numbers); };
    this.#set = set;
    this.#controls = controlsOf(parameter, () => this.#value, change);
    const inputs = document.createElement("div");
    inputs.append(...this.#controls.map((c) => c.axis ?? c.input));
    this.element.append(name, inputs, this.#shown, this.#reset);
    this.take(parameter.value);
  }

  #typed() {
    const { kind, low, high } = this.#parameter;
    return kind !== "choice" && !(kind === "whole" && low === 0 && high === 1);
  }

  // The value as a text that can be typed over; Escape leaves it as it was.
  #field() {
    const input = Object.assign(document.createElement("input"), { type: "text", spellcheck: false, autocomplete: "off" });
    input.setAttribute("aria-label", `${this.#parameter.name}, value`);
    input.onfocus = () => { input.value = exact(this.#value); input.select(); };
    input.onblur = () => this.#label(this.#value);
    input.onchange = () => {
      if (input.value !== exact(this.#value)) this.#type(input.value.trim());
      input.value = exact(this.#value);
    };
    input.onkeydown = (e) => { if (e.key === "Escape") { input.value = exact(this.#value); input.blur(); } };
    return input;
  }

  #type(text) {
    const { kind, low, high, unit, default: { length } } = this.#parameter;
    const coloured = ["color", "light"].includes(kind);
    let numbers = coloured && SRGB.test(text) ? rgbOf(text) : numbersIn(text, unit);
    if (numbers.length === 1 && coloured) numbers = Array(length).fill(numbers[0]);
    if (numbers.length !== length || kind === "direction" && !Math.hypot(...numbers)) return;
    numbers = numbers.map((x) => clamp(kind === "whole" ? Math.round(x) : x, low, high));
    this.take(numbers);
    this.#set(numbers);
  }

  take(value) {
    this.#value = value;
    for (const control of this.#controls) control.take(value);
    this.#label(value);
  }

  #label(value) {
    const numbers = value.map(short).join(" "), { unit } = this.#parameter;
    const text = this.#parameter.kind === "choice" ? "" : unit && value.length === 1 ? `${numbers} ${unit}` : numbers;
    const shows = this.#typed() ? "value" : "textContent";
    if (this.#shown[shows] !== text && document.activeElement !== this.#shown) this.#shown[shows] = text;
    this.#shown.title = `${numbers} ${unit}`;
    this.#controls.forEach(({ input }, k) => {           // not where its thumb stands, but what it sets
      const own = this.#controls.length === value.length ? short(value[k]) : numbers;
      if (input.type === "range") input.setAttribute("aria-valuetext", `${own} ${unit}`.trim());
    });
    this.#reset.disabled = value.every((x, k) => x === this.#parameter.default[k]);
  }
}

function controlsOf(parameter, value, change) {
  const { name, kind } = parameter;
  if (kind === "color") return [colour(name, { of: (v) => v, to: (rgb) => change(rgb) })];
  if (kind === "light") {
    return [
      stops(name, Math.max(...parameter.default), {
        of: (v) => Math.max(...v), to: (x) => change(scaled(value(), x, parameter.default)),
      }),
      colour(name, { of: (v) => hue(v), to: (rgb) => change(scaled(rgb, Math.max(...value()) || 1, rgb)) }),
    ];
  }
  if (kind === "direction") {
    return [
      slider(`${name}, azimuth`, [-180, 180, 0.5], {
        of: (v) => DEGREES * Math.atan2(v[0], v[2]), to: (x) => change(direction(x, elevation(value()))),
      }),
      slider(`${name}, elevation`, [-89.5, 89.5, 0.5], {
        of: elevation, to: (x) => change(direction(DEGREES * Math.atan2(value()[0], value()[2]), x)),
      }),
    ];
  }
  if (kind === "position" || kind === "angles") {
    return AXES.map((axis, k) => lettered(axis, slider(`${name}, ${axis}`, reachOf(parameter, k), {
      of: (v) => v[k], to: (x) => change(value().map((old, n) => (n === k ? x : old))),
    })));
  }
  if (kind === "choice") return [choice(name, parameter.choices, { of: (v) => v[0], to: (x) => change([x]) })];
  const one = { of: (v) => v[0], to: (x) => change([kind === "whole" ? Math.round(x) : x]) };
  if (!(name in SOFT) && parameter.high - parameter.low > WIDEST) return [stops(name, parameter.default[0], one, parameter.low)];
  if (kind === "whole" && parameter.low === 0 && parameter.high === 1) return [tick(name, one)];
  const [low, high] = SOFT[name] ?? [parameter.low, parameter.high];
  return [slider(name, [low, high, kind === "whole" ? 1 : (high - low) / 960], one)];
}

// Ends and step of the slider of one axis.
function reachOf({ name, kind, high, default: configured }, k) {
  if (kind === "angles") return [-180, 180, 0.5];
  const offset = name.startsWith("objects.") ? high / SCENES_AWAY : 0;
  const reach = offset || 2 * Math.max(1, ...configured.map(Math.abs));
  return [configured[k] - reach, configured[k] + reach, reach / 500];
}

const elevation = (v) => DEGREES * Math.asin(clamp(v[1] / Math.hypot(...v), -1, 1));
const hue = (v) => v.map((x) => x / (Math.max(...v) || 1));

function direction(azimuth, up) {
  const a = azimuth / DEGREES, e = up / DEGREES;
  return [Math.cos(e) * Math.sin(a), Math.sin(e), Math.cos(e) * Math.cos(a)];
}

// The colour of `rgb` with `most` as its largest part; black takes the colour of `other`.
function scaled(rgb, most, other) {
  const shape = Math.max(...rgb) > 0 ? rgb : Math.max(...other) > 0 ? other : [1, 1, 1];
  return hue(shape).map((x) => x * most);
}

// A slider with the letter of its axis before it, in the colour of its handle.
function lettered(letter, control) {
  const axis = Object.assign(document.createElement("label"), { className: "axis", textContent: letter });
  axis.dataset.axis = letter;
  axis.append(control.input);
  return { ...control, axis };
}

function slider(name, [low, high, step], { of, to }) {
  const input = Object.assign(document.createElement("input"), { type: "range", min: low, max: high, step });
  input.setAttribute("aria-label", name);
  input.oninput = () => to(input.valueAsNumber);
  return { input, take: (value) => { input.value = of(value); } };
}

function tick(name, { of, to }) {
  const input = Object.assign(document.createElement("input"), { type: "checkbox" });
  input.setAttribute("aria-label", name);
  input.onchange = () => to(Number(input.checked));
  return { input, take: (value) => { input.checked = of(value) >= 0.5; } };
}

function choice(name, names, { of, to }) {
  const input = document.createElement("select");
  input.setAttribute("aria-label", name);
  input.append(...names.map((each, k) => new Option(each.replaceAll("_", " "), k)));
  input.onchange = () => to(Number(input.value));
  return { input, take: (value) => { input.value = of(value); } };
}

// A slider of powers of two about the configured value; its left end is `low`.
function stops(name, configured, { of, to }, low = 0) {
  const about = configured > 0 ? configured : 1;
  return slider(name, [-STOPS_BELOW, STOPS_ABOVE, 0.05], {
    of: (value) => (of(value) > 0 ? Math.log2(of(value) / about) : -STOPS_BELOW),
    to: (x) => to(x <= -STOPS_BELOW ? low : about * 2 ** x),
  });
}

function colour(name, { of, to }) {
  const input = Object.assign(document.createElement("input"), { type: "color" });
  input.setAttribute("aria-label", `${name}, colour`);
  input.oninput = () => to(rgbOf(input.value));
  return { input, take: (value) => { input.value = hexOf(of(value)); } };
}
