// What this page is sent: images, or samples of which it makes the images itself.

import { Painter } from "./painter.js";

const ADAPTIVE = "adaptive";
const LOST = "The browser took WebGL2 away: images are shown.";

const $ = (id) => document.getElementById(id);

export class Display {
  name = "images";
  #wall; #ask; #painter = null; #panels = []; #sampled = new Set(); #status = null; #failure = "";

  // `ask` tells the server what is wanted.
  constructor(wall, ask) {
    this.#wall = wall;
    this.#ask = ask;
    for (const input of $("displays").querySelectorAll("input")) input.onchange = () => this.choose(input.value);
    this.#show();
  }

  choose(name) {
    this.#stop();
    this.#failure = "";
    if (name === "samples") this.#start();
    this.#ask(this.name);
    this.#show();
  }

  next() { this.choose(this.name === "images" ? "samples" : "images"); }

  // After every new connection: the server forgets, and so does the page.
  build({ panels }) {
    this.#panels = panels;
    $("displays").hidden = panels.every((panel) => panel.why_images);   // no choice
    if (this.name === "samples") this.choose("samples");
    else this.#show();
  }

  status(status) {
    this.#status = status;
    this.#show();
  }

  // Samples of a panel came, or an image of it.
  samples(found) {
    const context = this.#wall.context(found.index);
    if (!context || !this.#painter?.take(found)) return;       // without a painter: of before images were asked for
    this.#painter.draw(found.index, context);
    this.#sampled.add(found.index);
  }

  image(index) { this.#sampled.delete(index); }

  #start() {
    try {
      this.#painter = new Painter();
    } catch (error) {
      this.#failure = `This browser cannot make images of samples (${error.message}): images are shown.`;
      return;
    }
    this.#painter.onlost = () => {
      this.choose("images");
      this.#failure = LOST;
      this.#show();
    };
    this.name = "samples";
  }

  #stop() {
    this.#painter?.close();
    this.#painter = null;
    this.#sampled.clear();
    this.name = "images";
  }

  #show() {
    for (const input of $("displays").querySelectorAll("input")) input.checked = input.value === this.name;
    document.body.dataset.display = this.name;
    document.body.dataset.sampled = this.#sampled.size;
    const words = this.#failure || (this.name === "samples" ? this.#words() : "");
    if ($("display-words").textContent !== words) {
      $("display-words").textContent = words;
      this.#wall.arrange();
    }
    $("display-words").hidden = !words;
  }

  // Which panels this page makes itself, and why it does not make the others.
  #words() {
    const images = this.#panels.filter((_, k) => !this.#sampled.has(k));
    const made = this.#panels.length - images.length;
    if (!images.length) return "Made by this page of the newest sample of each pixel.";
    const others = made ? `${images.length} of ${this.#panels.length} panels come as images` : "Images come";
    return `${others}: ${this.#why(images) || "their samples are on their way"}.`;
  }

  #why(images) {
    const always = images.find((panel) => panel.why_images)?.why_images;
    const adaptive = this.#status?.compare || this.#status?.view_samplers[images[0].view] === ADAPTIVE;
    return always || (adaptive && "the wall reprojects the adaptive sampler's samples itself");
  }
}
