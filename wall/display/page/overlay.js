// Draw overlays: age and density of samples by tiles of 16 pixels, and the tiles of the samplers.

import { GRADIENT, SCALE } from "./colors.js";

const HEADER_BYTES = 16;          // wall/display/stream.py, STATISTICS_HEADER
const TILE = 16;
const FILL = 0.4;                 // opacity of a tile's colour beneath its outline
const NAMES = ["", "tiles", "age", "density"];    // wall/display/steering.py, OVERLAYS

// Codes as in wall/reconstruction/statistics.py: value = 2^((code - 1) / steps + least); `range`: log2 of both ends shown.
export const KINDS = {
  tiles: {
    title: "Gain of a sample", steps: 8, least: -28, range: [-20, -4],
    ticks: [[-20, "little"], [-4, "much"]],
  },
  age: {
    title: "Age of samples", steps: 16, least: -10, range: [Math.log2(0.01), Math.log2(10)],
    ticks: [[Math.log2(0.01), "10 ms"], [Math.log2(0.1), "100 ms"], [0, "1 s"], [Math.log2(10), "10 s"]],
  },
  density: {
    title: "Samples a pixel", steps: 16, least: -8, range: [-4, 4],
    ticks: [[-4, "1/16"], [-2, "1/4"], [0, "1"], [2, "4"], [4, "16"]],
  },
};

const $ = (id) => document.getElementById(id);

export class Overlay {
  name = "";
  #wall; #ask; #tables = {};

  // `ask` tells the server which overlay is wanted.
  constructor(wall, ask) {
    this.#wall = wall;
    this.#ask = ask;
    for (const [name, kind] of Object.entries(KINDS)) this.#tables[name] = colorsOf(kind);
    for (const input of $("overlays").querySelectorAll("input")) {
      input.onchange = () => this.choose(input.value);
    }
    this.choose("");
  }

  choose(name) {
    this.name = name;
    for (const input of $("overlays").querySelectorAll("input")) input.checked = input.value === name;
    this.#wall.uncover();
    document.body.dataset.overlay = name;
    this.#legend();
    this.repeat();
  }

  // Also after every new connection: the server forgets.
  repeat() { this.#ask(this.name); }

  next() { this.choose(NAMES[(NAMES.indexOf(this.name) + 1) % NAMES.length]); }

  take(buffer) {
    const head = new DataView(buffer);
    if (NAMES[head.getUint8(6)] !== this.name) return;         // of the overlay before this one
    const shown = this.#wall.cover(head.getUint16(4, true), head.getUint8(3) === 1);
    if (!shown) return;
    const size = { rows: head.getUint16(8, true), columns: head.getUint16(10, true) };
    if (this.name === "tiles") this.#drawTiles(shown, buffer, head.getUint32(12, true));
    else this.#drawMap(shown, new Uint8Array(buffer, HEADER_BYTES), size);
  }

  // One pixel a tile; the page stretches it, and the panel cuts off what is beyond its edge.
  #drawMap({ canvas, rect }, codes, { rows, columns }) {
    canvas.width = columns;
    canvas.height = rows;
    canvas.style.width = `${(100 * columns * TILE) / rect.width}%`;
    canvas.style.height = `${(100 * rows * TILE) / rect.height}%`;
    const context = canvas.getContext("2d"), image = context.createImageData(columns, rows);
    const table = this.#tables[this.name];
    codes.forEach((code, k) => image.data.set(table[code], 4 * k));
    context.putImageData(image, 0, 0);
  }

  #drawTiles({ canvas, rect }, buffer, count) {
    const rects = new Uint16Array(buffer, HEADER_BYTES, 4 * count);
    const error_reduction = new Uint8Array(buffer, HEADER_BYTES + 8 * count, count);
    const ratio = window.devicePixelRatio || 1;
    canvas.style.width = canvas.style.height = "100%";
    canvas.width = Math.round(canvas.clientWidth * ratio);
    canvas.height = Math.round(canvas.clientHeight * ratio);
    const c = canvas.getContext("2d");
    const across = (x) => Math.round((x * canvas.width) / rect.width);
    const down = (y) => Math.round((y * canvas.height) / rect.height);
    for (let k = 0; k < count; k++) {
      const [x, y, w, h] = rects.subarray(4 * k, 4 * k + 4);
      const left = across(x), top = down(y), width = across(x + w) - left, height = down(y + h) - top;
      const [red, green, blue, alpha] = this.#tables.tiles[error_reduction[k]];
      c.fillStyle = `rgb(${red} ${green} ${blue} / ${FILL * alpha / 255})`;
      c.fillRect(left, top, width, height);
      c.strokeStyle = `rgb(${red} ${green} ${blue})`;
      c.strokeRect(left + 0.5, top + 0.5, width - 1, height - 1);
    }
  }

  #legend() {
    const kind = KINDS[this.name];
    $("legend").hidden = !kind;
    if (!kind) return;
    $("legend-title").textContent = kind.title;
    $("legend-scale").style.backgroundImage = GRADIENT;
    const [low, high] = kind.range;
    $("legend-ticks").replaceChildren(...kind.ticks.map(([log, text]) => {
      const tick = Object.assign(document.createElement("span"), { textContent: text });
      const at = (log - low) / (high - low);
      tick.style.left = `${100 * at}%`;
      tick.style.translate = `${-100 * at}% 0`;                // what marks an end stays within it
      return tick;
    }));
    this.#wall.arrange();
  }
}

// (256) [red, green, blue, alpha] of codes; nothing is drawn where there is nothing.
function colorsOf({ steps, least, range: [low, high] }) {
  return Array.from({ length: 256 }, (_, code) => {
    if (code === 0) return [0, 0, 0, 0];
    const at = ((code - 1) / steps + least - low) / (high - low);
    return [...SCALE[Math.round(255 * Math.min(Math.max(at, 0), 1))], 255];
  });
}
