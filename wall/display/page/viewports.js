// Which view is steered: a key goes on to the next one, a drag takes the one beneath the pointer.

import { check, fill } from "./choice.js";

const $ = (id) => document.getElementById(id);

export class Viewports {
  steered = 0;
  onsteer = () => {};
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
    fill($("steered"), "steered", views, (name) => `Steer ${name} (n: the next)`, (_, k) => this.steer(k));
    check($("steered"), views[0]);
  }

  get several() { return this.#names.length > 1; }

  next() { this.steer((this.steered + 1) % this.#names.length); }

  steer(view) {
    this.steered = view;
    check($("steered"), this.#names[view]);
    this.onsteer(view);
    this.#wall.outline(this.#places.filter((place) => place.view === view));
  }

  // What keys point at: the middle of what the steered view has of the wall, or the pixel of a panel that is nearest to
  // it, for a bezel may be there. In fractions of the wall; undefined before there is one.
  middle() {
    const places = this.#places.filter((place) => place.view === this.steered);
    const [x, y] = [["x", "width"], ["y", "height"]].map(([at, size]) =>
      (Math.min(...places.map((p) => p[at])) + Math.max(...places.map((p) => p[at] + p[size]))) / 2);
    const within = (p) => ({
      u: Math.min(Math.max(x, p.x + 0.5), p.x + p.width - 0.5), v: Math.min(Math.max(y, p.y + 0.5), p.y + p.height - 0.5),
    });
    const away = ({ u, v }) => Math.hypot(u - x, v - y);
    const [nearest] = places.map(within).sort((a, b) => away(a) - away(b));
    return nearest && { x: nearest.u / this.#size.width, y: nearest.v / this.#size.height };
  }

  // Steer what is shown at a place, in fractions of the wall.
  take(place) {
    const x = place.x * this.#size.width, y = place.y * this.#size.height;
    const inside = (p) => x >= p.x && x < p.x + p.width && y >= p.y && y < p.y + p.height;
    const found = this.#places.findLast(inside);
    if (this.several && found && found.view !== this.steered) this.steer(found.view);
  }
}
