// Handles at each object that is selected: one along each axis of the world, drawn over the image; a drag along one
// moves the object. Each viewport of the wall shows those of its view's selection, seen by its own camera.

const LENGTH = 84;                // CSS pixels, of the longest axis,
const LARGEST = 0.35;             // but no more of what its view has of the wall
const SHORTEST = 0.2;             // of it: what points at the eye cannot be drawn along it
const AXES = ["x", "y", "z"];
const EVERY_AXIS = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];

const svg = (name, className) => {
  const element = document.createElementNS("http://www.w3.org/2000/svg", name);
  if (className) element.setAttribute("class", className);
  return element;
};

// w, x w, y w on the wall of a vector in world units, from a place's matrix without its last column.
const turned = (m, v) => [0, 4, 8].map((row) => m[row] * v[0] + m[row + 1] * v[1] + m[row + 2] * v[2]);
// and of a point, by how much it is away from the object's middle.
const placed = (m, v) => turned(m, v).map((x, k) => x + m[4 * k + 3]);

export class Handles {
  #wall; #send; #said = { places: [] }; #limits = new Map(); #groups = []; #key = ""; #drag = null; #due = false;

  // `send` takes the name of a parameter and its numbers.
  constructor(wall, send) {
    this.#wall = wall;
    this.#send = send;
    window.addEventListener("keydown", (e) => { if (e.key === "Escape" && this.#drag) this.#cancel(); });
    new ResizeObserver(() => this.#draw()).observe(document.getElementById("wall"));
  }

  // Where objects stand, as the run says.
  show(message) {
    if (this.#drag && message.places[this.#drag.k]?.parameter !== this.#drag.parameter) this.#drag = null;
    this.#said = message;
    this.#draw();
  }

  limit(parameters) {
    this.#limits = new Map(parameters.map(({ name, low, high }) => [name, { low, high }]));
  }

  #draw() {
    const drawing = this.#wall.drawing();
    if (!drawing) return;
    const { places } = this.#said;
    const key = JSON.stringify(places.map(({ parameter, rect }) => [parameter, rect]));
    if (key !== this.#key || drawing.childElementCount !== 2 * this.#groups.length) this.#build(drawing, key);
    const scale = drawing.viewBox.baseVal.width / (drawing.getBoundingClientRect().width || 1);   // pixels in a CSS pixel
    places.forEach(({ view, wall_from_object }, k) => {
      const rects = places.filter((place) => place.view === view).map(({ rect }) => rect);
      this.#groups[k].put(wall_from_object, Math.min(LENGTH * scale, LARGEST * least(rects)));
    });
  }

  #build(drawing, key) {
    this.#key = key;
    const { places } = this.#said;
    const move = (e) => this.#move(e), end = () => this.#end();
    this.#groups = places.map((_, k) => new Group((axis, e) => this.#begin(k, axis, e), move, end));
    const clips = places.map(({ view, rect }, k) => {
      const others = places.filter((place, other) => place.view === view && other !== k).map((place) => place.rect);
      return clip(`handles-${k}`, overBezels(rect, others), places.slice(k + 1).map((place) => place.rect));
    });
    this.#groups.forEach((group, k) => group.element.setAttribute("clip-path", `url(#handles-${k})`));
    drawing.replaceChildren(...clips, ...this.#groups.map((group) => group.element));
  }

  #begin(k, axis, e) {
    const { parameter, value } = this.#said.places[k];
    this.#drag = { k, axis, parameter, start: value, from: 0 };
    this.#drag.from = this.#along(e) ?? 0;
  }

  // How far along its axis from where the drag began the pointer is, in world units; null where it cannot be said.
  #along(e) {
    const { k, axis, start } = this.#drag, place = this.#said.places[k];
    if (!place) return null;
    const { wall_from_object: m, value } = place;
    const [w, x, y] = placed(m, start.map((s, n) => s - value[n])), [aw, ax, ay] = turned(m, EVERY_AXIS[axis]);
    const across = (ax - (x / w) * aw), down = (ay - (y / w) * aw), size = Math.hypot(across, down);
    if (!(w > 0) || !(size > 0)) return null;
    const at = this.#at(e), way = ((at.x - x / w) * across + (at.y - y / w) * down) / size;
    const rate = size - way * aw;                        // straight lines stay straight, but not their divisions
    return rate > 0 ? (way * w) / rate : null;
  }

  #at(e) {
    return new DOMPoint(e.clientX, e.clientY).matrixTransform(this.#wall.drawing().getScreenCTM().inverse());
  }

  // At most one command an animation frame.
  #move(e) {
    const along = this.#drag && this.#along(e);
    if (along === null) return;
    const { parameter, start, axis, from } = this.#drag;
    const { low, high } = this.#limits.get(parameter) ?? { low: -Infinity, high: Infinity };
    const moved = [...start];
    moved[axis] = Math.min(high, Math.max(low, start[axis] + along - from));
    if (!this.#due) requestAnimationFrame(() => this.#flush());
    this.#due = true;
    this.#drag.wanted = moved;
  }

  #flush() {
    this.#due = false;
    if (this.#drag?.wanted) this.#send(this.#drag.parameter, this.#drag.wanted);
    if (this.#drag) this.#drag.wanted = null;
  }

  #end() {
    this.#flush();
    this.#drag = null;
  }

  #cancel() {
    const { parameter, start } = this.#drag;
    this.#drag = null;
    this.#send(parameter, start);
    for (const group of this.#groups) group.release();
  }
}

// A viewport, without those that lie over it.
function clip(id, rect, over) {
  const path = svg("path"), element = svg("clipPath");
  const outline = ([x, y, width, height]) => `M${x} ${y}h${width}v${height}h${-width}z`;
  path.setAttribute("d", [rect, ...over.filter((other) => inside(other, rect))].map(outline).join(""));
  path.setAttribute("clip-rule", "evenodd");
  element.id = id;
  element.append(path);
  return element;
}

// A rectangle with half of the gaps to those beside, above and below it: handles are seen over bezels, too.
function overBezels([x, y, width, height], others) {
  const half = (gaps) => Math.min(...gaps.filter((gap) => gap >= 0), Infinity) / 2;
  const beside = others.filter(([, top, , down]) => top < y + height && top + down > y);
  const stacked = others.filter(([left, , across]) => left < x + width && left + across > x);
  const [left, right, above, below] = [
    half(beside.map(([at, , across]) => x - at - across)), half(beside.map(([at]) => at - x - width)),
    half(stacked.map(([, at, , down]) => y - at - down)), half(stacked.map(([, at]) => at - y - height)),
  ].map((gap) => (gap < Infinity ? gap : 0));
  return [x - left, y - above, width + left + right, height + above + below];
}

// Width or height of what some rectangles span, whichever is less.
const least = (rects) => Math.min(...[0, 1].map((k) =>
  Math.max(...rects.map((rect) => rect[k] + rect[k + 2])) - Math.min(...rects.map((rect) => rect[k]))));

const inside = ([x, y, width, height], [left, top, across, down]) =>
  x >= left && y >= top && x + width <= left + across && y + height <= top + down;

// The handles in one viewport.
class Group {
  element = svg("g", "handles");
  #axes; #middle = svg("line", "middle");

  constructor(begin, move, end) {
    this.#axes = AXES.map((name, axis) => this.#axis(name, (e) => begin(axis, e), move, end));
    this.element.setAttribute("aria-hidden", "true");        // sliders do the same
    this.element.append(...this.#axes.map(({ group }) => group), this.#middle);
  }

  // Stand where a place's matrix says, `length` virtual screen pixels long.
  put(m, length) {
    const [w, x, y] = placed(m, [0, 0, 0]);
    this.element.style.display = w > 0 ? "" : "none";
    if (!(w > 0)) return;
    const ways = EVERY_AXIS.map((axis) => {
      const [aw, ax, ay] = turned(m, axis);
      return [(ax - (x / w) * aw) / w, (ay - (y / w) * aw) / w];       // pixels of a world unit
    });
    const longest = Math.max(...ways.map(([a, b]) => Math.hypot(a, b)));
    this.#axes.forEach(({ group, lines, tip }, k) => {
      const [a, b] = ways[k].map((part) => (part * length) / longest), size = Math.hypot(a, b) / length;
      group.style.display = size < SHORTEST ? "none" : "";
      for (const line of lines) segment(line, x / w, y / w, x / w + a, y / w + b);
      segment(tip, x / w + a, y / w + b, x / w + a, y / w + b);
    });
    segment(this.#middle, x / w, y / w, x / w, y / w);
  }

  release() {
    for (const { group } of this.#axes) group.classList.remove("held");
  }

  #axis(name, begin, move, end) {
    const group = svg("g", `handle ${name}`), tip = svg("line", "tip");
    const lines = ["grip", "edge", "axis"].map((part) => svg("line", part));
    const said = Object.assign(svg("title"), { textContent: `Move along ${name}; Escape puts it back` });
    group.append(...lines, tip, said);
    group.addEventListener("pointerdown", (e) => {
      if (e.pointerType === "mouse" && e.button !== 0) return;
      e.stopPropagation();                                    // the camera stays
      e.preventDefault();
      group.setPointerCapture(e.pointerId);
      group.classList.add("held");
      begin(e);
    });
    group.addEventListener("pointermove", (e) => { if (group.classList.contains("held")) move(e); });
    for (const over of ["pointerup", "pointercancel", "lostpointercapture"]) {
      group.addEventListener(over, (e) => {
        if (!group.classList.contains("held")) return;
        e.stopPropagation();
        group.classList.remove("held");
        end();
      });
    }
    group.addEventListener("dblclick", (e) => e.stopPropagation());
    return { group, lines, tip };
  }
}

function segment(line, x1, y1, x2, y2) {
  Object.entries({ x1, y1, x2, y2 }).forEach(([name, value]) => line.setAttribute(name, value));
}
