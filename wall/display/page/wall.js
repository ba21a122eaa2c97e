// The wall on the page: one canvas a panel at its true place, edges on whole device pixels.

const DETAILS_WIDTH = 388;        // page.css, --details
const BELOW_HEIGHT = 232;         // what the measurements need beneath the wall,
const BELOW_ENOUGH = 344;         // and what they take when there is room
const NARROW = 900;               // below this width everything is one scrolling column
const FRAME = [0.012, 0.05];      // least and most width of the outer bezel, of the wall's height

export class Wall {
  #element; #room; #layout = null; #panels = []; #frame = 0;

  constructor(element, room) {
    this.#element = element;
    this.#room = room;
    new ResizeObserver(() => this.arrange()).observe(room);
  }

  // Height of the wall as shown, CSS pixels.
  height() { return this.#element.clientHeight || 1; }

  build(layout) {
    if (JSON.stringify(layout) === JSON.stringify(this.#layout)) return;   // the pictures of before stay
    this.#layout = layout;
    this.#frame = outerBezel(layout);
    this.#panels = layout.panels.map((place) => {
      const canvas = document.createElement("canvas");
      canvas.width = place.width;
      canvas.height = place.height;
      canvas.dataset.panel = place.id;
      const box = document.createElement("div");
      box.className = "panel";
      box.append(canvas);
      return { place, box, context: canvas.getContext("2d", { alpha: false }) };
    });
    this.#element.replaceChildren(...this.#panels.map((p) => p.box));
    this.arrange();
  }

  draw(index, image) {
    const panel = this.#panels[index];
    panel?.context.drawImage(image, 0, 0, panel.place.width, panel.place.height);
    image.close();
  }

  // Outline one panel, or none.
  point(id) {
    for (const { place, box } of this.#panels) box.classList.toggle("pointed", place.id === id);
  }

  arrange() {
    if (!this.#layout) return;
    const { width, height } = this.#layout;
    const frame = this.#frame;
    const full = { width: width + 2 * frame, height: height + 2 * frame };
    const scale = this.#choosePlace(full);
    const ratio = window.devicePixelRatio || 1;
    const snap = (x) => Math.round(x * scale * ratio) / ratio;
    this.#element.style.width = `${snap(full.width)}px`;
    this.#element.style.height = `${snap(full.height)}px`;
    this.#room.style.setProperty("--wall-height", `${snap(full.height)}px`);
    for (const { place, box } of this.#panels) {
      const left = snap(place.x + frame), top = snap(place.y + frame);
      box.style.left = `${left}px`;
      box.style.top = `${top}px`;
      box.style.width = `${snap(place.x + place.width + frame) - left}px`;
      box.style.height = `${snap(place.y + place.height + frame) - top}px`;
    }
  }

  // Measurements beside the wall or beneath it, whichever leaves the wall larger. Returns CSS pixels a wall pixel.
  #choosePlace(full) {
    const style = getComputedStyle(this.#room);
    const gap = parseFloat(style.columnGap) || 0;
    const w = this.#room.clientWidth - parseFloat(style.paddingLeft) - parseFloat(style.paddingRight);
    const h = this.#room.clientHeight - parseFloat(style.paddingTop) - parseFloat(style.paddingBottom);
    const fit = (x, y) => Math.max(0.02, Math.min(x / full.width, y / full.height));
    const narrow = window.innerWidth < NARROW;
    const bare = document.body.classList.contains("bare");
    const beside = fit(w - DETAILS_WIDTH - gap, h), beneath = fit(w, h - BELOW_HEIGHT - gap);
    const kind = narrow ? "column" : bare ? "alone" : beside >= beneath ? "beside" : "beneath";
    this.#room.dataset.kind = kind;
    if (kind === "column") return fit(w, bare ? h : Math.max(0.62 * window.innerHeight, 160));
    const left = h - gap - full.height * beneath;
    this.#room.style.setProperty("--below", `${Math.max(BELOW_HEIGHT, Math.min(BELOW_ENOUGH, left))}px`);
    return kind === "alone" ? fit(w, h) : Math.max(beside, beneath);
  }
}

// The virtual screen ends at its outermost panels; they get the bezel that stands between panels.
function outerBezel({ height, panels }) {
  const gaps = panels.flatMap((p) => panels.map((q) => q.x - p.x - p.width)).filter((gap) => gap > 0);
  const half = gaps.reduce((least, gap) => Math.min(least, gap), Infinity) / 2;
  return Math.max(FRAME[0] * height, Math.min(FRAME[1] * height, Number.isFinite(half) ? half : 0));
}
