// Show the wall: one canvas a panel at its true position, edges on whole device pixels. While two samplers are
// compared there are two such faces, one over or beside the other.

const BELOW_HEIGHT = 232;         // what the measurements need beneath the wall,
const BELOW_ENOUGH = 344;         // and what they take when there is room
const NARROW = 900;               // below this width everything is one scrolling column
const FRAME = [0.012, 0.05];      // least and most width of the outer bezel, of the wall's height
const TILE = 32;                  // pixels; wall/display/tiles.py
const APART = 0.04;               // between two faces, of the wall's height
const MARK = 0.04;                // width of what marks a place, of it too

export class Wall {
  #element; #room; #controls; #layout = null; #frame = 0; #view = "single";
  #outlines = [];                 // { element, rect }
  #stale = [];                    // { element, place, rect }
  #faces = [];                    // first and second: { element, panels: [{ rect, box, context }], missing: panels not drawn yet }

  // `controls` stand beneath the wall and keep their room.
  constructor(element, room, controls) {
    this.#element = element;
    this.#room = room;
    this.#controls = controls;
    const observer = new ResizeObserver(() => this.arrange());
    observer.observe(room);
    observer.observe(controls);
  }

  // Height of the picture as shown, CSS pixels.
  height() { return this.#faces[0]?.element.clientHeight || 1; }

  build(layout) {
    if (JSON.stringify(layout) === JSON.stringify(this.#layout)) return;   // the pictures of before stay
    this.#layout = layout;
    this.#frame = outerBezel(layout);
    for (const face of this.#faces) face.element.remove();
    this.#faces = [];
    this.#stale = [];
    this.#addFace();
    this.show(this.#view);
  }

  // "single", "wipe" or "beside"
  show(view) {
    this.#view = view;
    if (!this.#layout) return;
    if (view !== "single" && this.#faces.length === 1) this.#addFace();
    if (this.#faces[1]) this.#faces[1].element.hidden = view === "single";
    this.arrange();
  }

  // Draw an image of a panel, or of some of its tiles: their numbers, and the image in which they are packed.
  draw(index, image, second, tiles) {
    const panel = this.#faces[second ? 1 : 0]?.panels[index];
    if (panel && tiles.length) drawTiles(panel, image, tiles);
    else panel?.context.drawImage(image, 0, 0, panel.rect.width, panel.rect.height);
    if (panel && second) this.#drawn(this.#faces[1], panel);
    image.close();
  }

  // A face is empty until all of its panels were drawn.
  #drawn(face, panel) {
    face.missing.delete(panel);
    if (!face.missing.size) face.element.classList.remove("empty");
  }

  // What a panel's first image is drawn with; undefined before there is one.
  context(index) { return this.#faces[0]?.panels[index]?.context; }

  // The canvas over one panel, made when first asked for, and the rectangle of the panel; undefined if it is not shown.
  cover(index, second) {
    const panel = second && this.#view === "single" ? undefined : this.#faces[second ? 1 : 0]?.panels[index];
    if (panel && !panel.cover) {
      panel.cover = document.createElement("canvas");
      panel.cover.className = "cover";
      panel.box.append(panel.cover);
    }
    return panel && { canvas: panel.cover, rect: panel.rect };
  }

  uncover() {
    for (const panel of this.#faces.flatMap((face) => face.panels)) {
      panel.cover?.remove();
      panel.cover = undefined;
    }
  }

  // A drawing over the first image of the wall, in pixels of the virtual screen; undefined before there is one.
  drawing() {
    const face = this.#faces[0];
    if (face && !face.drawing) {
      const { width, height } = this.#layout, frame = this.#frame;
      face.drawing = document.createElementNS("http://www.w3.org/2000/svg", "svg");
      face.drawing.setAttribute("viewBox", `${-frame} ${-frame} ${width + 2 * frame} ${height + 2 * frame}`);
      face.drawing.setAttribute("preserveAspectRatio", "none");
      face.element.append(face.drawing);
    }
    return face?.drawing;
  }

  // Where a point of the page lies on the wall, in fractions of its width and height; undefined where no panel is.
  at(clientX, clientY) {
    for (const { rect, box } of this.#faces.flatMap((face) => (face.element.hidden ? [] : face.panels))) {
      const own = box.getBoundingClientRect();
      const x = (clientX - own.left) / own.width, y = (clientY - own.top) / own.height;
      if (x >= 0 && x < 1 && y >= 0 && y < 1) {
        return { x: (rect.x + x * rect.across) / this.#layout.width, y: (rect.y + y * rect.down) / this.#layout.height };
      }
    }
    return undefined;
  }

  // Outline one panel, or none.
  point(id) {
    for (const { rect, box } of this.#faces.flatMap((face) => face.panels)) {
      box.classList.toggle("pointed", rect.id === id);
    }
  }

  // Mark rectangles of the wall, [x, y, width, height], that get nothing new: their last image stays.
  markStale(places) {
    if (JSON.stringify(places) === JSON.stringify(this.#stale.map(({ place }) => place))) return;
    for (const { element } of this.#stale) element.remove();
    this.#stale = places.map((place) => {
      const element = Object.assign(document.createElement("div"), { className: "stale" });
      element.append(Object.assign(document.createElement("span"), { textContent: "no new samples" }));
      const [x, y, width, height] = place;
      return { element, place, rect: { x, y, width, height } };
    });
    this.#faces[0]?.element.append(...this.#stale.map(({ element }) => element));
    this.arrange();
  }

  // Outline rectangles of the wall for a moment.
  outline(rects) {
    for (const { element } of this.#outlines) element.remove();
    this.#outlines = rects.map((rect) => {
      const element = Object.assign(document.createElement("div"), { className: "outline" });
      element.onanimationend = () => element.remove();
      return { element, rect };
    });
    this.#faces[0]?.element.append(...this.#outlines.map(({ element }) => element));
    this.arrange();
  }

  // Outline a place, in fractions of the wall, for a moment.
  mark({ x, y }) {
    const { width, height } = this.#layout, half = MARK * height / 2;
    this.outline([{ x: x * width - half, y: y * height - half, width: 2 * half, height: 2 * half }]);
  }

  arrange() {
    if (!this.#layout) return;
    const { width, height } = this.#layout, frame = this.#frame;
    const full = { width: width + 2 * frame, height: height + 2 * frame };
    const { scale, whole, step } = this.#chooseSize(full);
    const ratio = window.devicePixelRatio || 1;
    const snap = (x) => Math.round(x * scale * ratio) / ratio;
    this.#element.style.width = `${snap(whole.width)}px`;
    this.#element.style.height = `${snap(whole.height)}px`;
    this.#room.style.setProperty("--wall-height", `${snap(whole.height) + this.#below()}px`);
    this.#faces.forEach(({ element, panels }, k) => {
      put(element, snap(k * step.x), snap(k * step.y), snap(full.width), snap(full.height));
      for (const { rect, box } of panels) {
        const left = snap(rect.x + frame), top = snap(rect.y + frame);
        put(box, left, top, snap(rect.x + rect.across + frame) - left, snap(rect.y + rect.down + frame) - top);
      }
    });
    for (const { element, rect } of [...this.#outlines, ...this.#stale]) {
      const left = snap(rect.x + frame), top = snap(rect.y + frame);
      put(element, left, top, snap(rect.x + rect.width + frame) - left, snap(rect.y + rect.height + frame) - top);
    }
    this.#element.style.setProperty("--right-x", `${snap(step.x)}px`);
    this.#element.style.setProperty("--right-y", `${snap(step.y)}px`);
    this.#element.dataset.stacked = step.y > 0;
  }

  #addFace() {
    const panels = this.#layout.panels.map((rect) => {
      const canvas = document.createElement("canvas");
      canvas.width = rect.width;
      canvas.height = rect.height;
      canvas.dataset.panel = rect.id;
      const box = document.createElement("div");
      box.className = "panel";
      box.append(canvas);
      return { rect, box, context: canvas.getContext("2d", { alpha: false }) };
    });
    const element = document.createElement("div");
    element.className = this.#faces.length ? "face second empty" : "face";
    element.append(...panels.map((p) => p.box));
    this.#faces.push({ element, panels, missing: new Set(panels) });
    this.#element.prepend(...this.#faces.map((face) => face.element));
  }

  // Two faces stand beside each other or one above the other, whichever leaves them larger.
  #chooseSize(full) {
    const gap = APART * full.height;
    const ways = this.#view !== "beside"
      ? [{ whole: full, step: { x: 0, y: 0 } }]
      : [
        { whole: { width: 2 * full.width + gap, height: full.height }, step: { x: full.width + gap, y: 0 } },
        { whole: { width: full.width, height: 2 * full.height + gap }, step: { x: 0, y: full.height + gap } },
      ];
    const scales = ways.map(({ whole }) => this.#choosePlace(whole));
    const best = scales.indexOf(Math.max(...scales));
    return { ...ways[best], scale: this.#choosePlace(ways[best].whole) };
  }

  // What the controls and the gap above them take.
  #below() {
    const height = this.#controls.offsetHeight;
    return height ? height + (parseFloat(getComputedStyle(this.#controls.parentElement).rowGap) || 0) : 0;
  }

  // Measurements beside the wall or beneath it, whichever leaves the wall larger. Returns CSS pixels a wall pixel.
  #choosePlace(full) {
    const style = getComputedStyle(this.#room);
    const gap = parseFloat(style.columnGap) || 0, below = this.#below();
    const details = parseFloat(style.getPropertyValue("--details"));
    const w = this.#room.clientWidth - parseFloat(style.paddingLeft) - parseFloat(style.paddingRight);
    const h = this.#room.clientHeight - parseFloat(style.paddingTop) - parseFloat(style.paddingBottom) - below;
    const fit = (x, y) => Math.max(0.02, Math.min(x / full.width, y / full.height));
    const narrow = window.innerWidth < NARROW;
    const bare = document.body.classList.contains("bare");
    const beside = fit(w - details - gap, h), beneath = fit(w, h - BELOW_HEIGHT - gap);
    const kind = narrow ? "column" : bare ? "alone" : beside >= beneath ? "beside" : "beneath";
    this.#room.dataset.kind = kind;
    if (kind === "column") return fit(w, bare ? h : Math.max(0.62 * window.innerHeight, 160));
    const left = h - gap - full.height * beneath;
    this.#room.style.setProperty("--below", `${Math.max(BELOW_HEIGHT, Math.min(BELOW_ENOUGH, left))}px`);
    return kind === "alone" ? fit(w, h) : Math.max(beside, beneath);
  }
}

function drawTiles({ context, rect }, image, tiles) {
  const across = image.width / TILE, columns = Math.ceil(rect.width / TILE);
  const spot = (k, n) => [TILE * (k % n), TILE * Math.floor(k / n)];
  tiles.forEach((tile, k) => context.drawImage(image, ...spot(k, across), TILE, TILE, ...spot(tile, columns), TILE, TILE));
}

function put({ style }, left, top, width, height) {
  style.left = `${left}px`;
  style.top = `${top}px`;
  style.width = `${width}px`;
  style.height = `${height}px`;
}

// The virtual screen ends at its outermost panels; they get the bezel that stands between panels.
function outerBezel({ height, panels }) {
  const gaps = panels.flatMap((p) => panels.map((q) => q.x - p.x - p.across)).filter((gap) => gap > 0);
  const half = gaps.reduce((least, gap) => Math.min(least, gap), Infinity) / 2;
  return Math.max(FRAME[0] * height, Math.min(FRAME[1] * height, Number.isFinite(half) ? half : 0));
}
