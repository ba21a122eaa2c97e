// One panel alone: what a browser in full screen shows on the panel's own display. The address ends in # and its id.

import { Calibration } from "./calibration.js";

export class Solo {
  #wall; #panel = null; #calibration = null; #box = null; #colour = "";

  constructor(wall) {
    this.#wall = wall;
    window.addEventListener("hashchange", () => location.reload());
  }

  // The panel that the address names has the page to itself, turned back as its display is mounted turned.
  async build({ panels }) {
    const id = decodeURIComponent(location.hash.slice(1));
    this.#panel = panels.find((panel) => panel.id === id) ?? null;
    document.body.classList.toggle("solo", this.#panel !== null);
    if (!this.#panel) return;
    document.title = id;
    const { rotation, colour } = this.#panel, canvas = this.#canvas();
    if (this.#box !== canvas.parentElement || this.#colour !== JSON.stringify(colour)) {
      this.#calibration?.canvas.remove();
      [this.#box, this.#colour, this.#calibration] = [canvas.parentElement, JSON.stringify(colour), null];
      this.#box.classList.add("own");
      this.#box.dataset.rotation = rotation;
      if (colour) await this.#calibrate(id, colour);
    }
    this.draw();
  }

  // After every picture.
  draw() {
    const canvas = this.#panel && this.#calibration && this.#canvas();
    if (canvas) this.#calibration.draw(canvas);
  }

  #canvas() { return this.#wall.context(this.#panel.index).canvas; }

  async #calibrate(id, colour) {
    const table = colour.table ? await (await fetch(`table/${encodeURIComponent(id)}`)).arrayBuffer() : null;
    if (this.#colour !== JSON.stringify(colour)) return;       // another came meanwhile
    this.#calibration = new Calibration(colour, table);
    this.#box.append(this.#calibration.canvas);
  }
}
