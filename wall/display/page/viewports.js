// Which view is steered: Tab goes on to the next one, a drag takes the one beneath the pointer.

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
    $("steered").replaceChildren(...views.map((name, k) => {
      const label = document.createElement("label");
      const input = Object.assign(document.createElement("input"), { type: "radio", name: "steered", value: name });
      input.checked = k === 0;
      input.onchange = () => this.steer(k);
      label.title = `Steer ${name} (tab)`;
      label.append(input, Object.assign(document.createElement("span"), { textContent: name }));
      return label;
    }));
  }

  get several() { return this.#names.length > 1; }

  next() { this.steer((this.steered + 1) % this.#names.length); }

  steer(view) {
    this.steered = view;
    for (const [k, input] of [...$("steered").querySelectorAll("input")].entries()) input.checked = k === view;
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
