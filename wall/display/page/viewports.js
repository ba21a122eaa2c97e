// Which view is steered: Tab goes on to the next one, a drag takes the one beneath the pointer.

import { check, fill } from "./choice.js";

const $ = (id) => document.getElementById(id);

export class Viewports {
  steered = 0;
  #wall; #names = []; #places = []; #size = null;

  constructor(wall) { this.#wall = wall; }

  // From the first message: the views' names, and where each is on the wall, the nearest last.
  build({ views, panels, insets, width, height }) {
    this.#size = { width, height };
    this.#places = [...panels.map((p) => ({ ...p, width: p.across, height: p.down })), ...insets];
    $("steered").hidden = views.length < 2;
    $("views").hidden = views.length > 1;             // two samplers are compared on all of the wall
    if (views.join() === this.#names.join()) return;
    this.#names = views;
    this.steered = 0;
    fill($("steered"), "steered", views, (name) => `Steer ${name} (tab)`, (_, k) => this.steer(k));
    check($("steered"), views[0]);
  }

  get several() { return this.#names.length > 1; }

  next() { this.steer((this.steered + 1) % this.#names.length); }

  steer(view) {
    this.steered = view;
    check($("steered"), this.#names[view]);
    this.#wall.outline(this.#places.filter((place) => place.view === view));
  }

  // Steer what is shown at a place, in fractions of the wall.
  take(place) {
    const x = place.x * this.#size.width, y = place.y * this.#size.height;
    const inside = (p) => x >= p.x && x < p.x + p.width && y >= p.y && y < p.y + p.height;
    const found = this.#places.findLast(inside);
    if (this.several && found && found.view !== this.steered) this.steer(found.view);
  }
}
