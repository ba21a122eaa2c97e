// One panel alone: what a browser in full screen shows on the panel's own display. The address ends in # and its id.

import { Calibration } from "./calibration.js";

export class Solo {
  #wall; #panel = null; #calibration = null; #box = null; #colour = ""; #note = document.createElement("p");

  constructor(wall) {
    this.#wall = wall;
    this.#note.className = "banner uncorrected";
    this.#note.role = "alert";
    window.addEventListener("hashchange", () => location.reload());
  }

  // The panel that the address names has the page to itself, turned back as its display is mounted turned.
  async build({ panels }) {
    const id = decodeURIComponent(location.hash.slice(1));
    this.#panel = panels.find((panel) => panel.id === id) ?? null;
    document.body.classList.toggle("solo", this.#panel !== null);
    this.#note.remove();
    if (!this.#panel) {
      if (id) this.#say(`There is no panel ${id}, so this is the whole wall: ${panels.map((each) => each.id).join(", ")}.`);
      return;
    }
    document.title = id;
    const { rotation, colour } = this.#panel, canvas = this.#canvas();
    if (this.#box !== canvas.parentElement || this.#colour !== JSON.stringify(colour)) {
      this.#calibration?.canvas.remove();
      this.#note.remove();
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

  // What cannot be had is said, and tried again with the next layout.
  async #calibrate(id, colour) {
    const wanted = this.#colour;
    try {
      const table = colour.table ? await tableOf(id) : null;
      if (this.#colour !== wanted) return;                     // another came meanwhile
      this.#calibration = new Calibration(colour, table);
      this.#box.append(this.#calibration.canvas);
    } catch (error) {
      if (this.#colour !== wanted) return;
      this.#colour = "";
      this.#say(`The colours are not those of this display: ${error.message}.`);
    }
  }

  #say(text) {
    this.#note.textContent = text;
    document.body.append(this.#note);
  }
}

async function tableOf(id) {
  const response = await fetch(`table/${encodeURIComponent(id)}`);
  if (!response.ok) throw new Error((await response.text()).trim());
  return response.arrayBuffer();
}
