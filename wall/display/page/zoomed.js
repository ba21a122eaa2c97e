// Very large images on the wall, `deep_zoom` nodes: drag, wheel and pinch over one move its place, not a camera.

const TRUST_MS = 700;             // what was just asked for is shown until the run says it
const KEYS = ["x", "y", "zoom"];

const clamp = (value, low, high) => Math.max(low, Math.min(high, value));

export class Zoomed {
  #send; #images = []; #size = { width: 1, height: 1 }; #known = new Map(); #asked = -Infinity; #steered = null;
  #said = []; #later;

  // `send` takes a command: `set` with a name and numbers.
  constructor(send) { this.#send = send; }

  // From the first message: where images are on the wall, virtual pixels, and how large they are there at zoom 0.
  build({ images = [], width, height }) {
    this.#images = images;
    this.#size = { width, height };
    this.#steered = null;
  }

  // What the run says that parameters are: at once, or when nothing was asked for a while, for it says it only once.
  follow(parameters) {
    this.#said = parameters;
    clearTimeout(this.#later);
    const wait = this.#asked + TRUST_MS - performance.now();
    if (wait > 0) {
      this.#later = setTimeout(() => this.follow(this.#said), wait);
      return;
    }
    for (const { name, value, low, high } of parameters) {
      if (name.startsWith("nodes.")) this.#known.set(name, { value: value[0], low, high });
    }
  }

  // Take the image at a place, in fractions of the wall, or none.
  take({ x, y }) {
    const [u, v] = [x * this.#size.width, y * this.#size.height];
    const image = this.#images.findLast((i) => u >= i.x && u < i.x + i.width && v >= i.y && v < i.y + i.height);
    this.#steered = image && { ...image, u: u - image.x - image.width / 2, v: v - image.y - image.height / 2 };
  }

  // Another view is steered.
  release() { this.#steered = null; }

  // Move the image that was taken by so many heights of the wall, and enlarge it about where it was taken. Returns
  // whether one was.
  move(dx, dy, factor) {
    const image = this.#steered;
    const [x, y, zoom] = KEYS.map((key) => this.#known.get(`nodes.${image?.node}.${key}`));
    if (!x || !y || !zoom) return false;
    const before = 2 ** -zoom.value, doublings = clamp(zoom.value + Math.log2(factor), zoom.low, zoom.high);
    const after = 2 ** -doublings;
    this.#set(image, "zoom", doublings);
    this.#set(image, "x", x.value + (image.u * (before - after) - dx * this.#size.height * after) / image.fit[0]);
    this.#set(image, "y", y.value + (image.v * (before - after) - dy * this.#size.height * after) / image.fit[1]);
    return true;
  }

  reset() {
    for (const key of this.#steered ? KEYS : []) {
      this.#send({ kind: "set", name: `nodes.${this.#steered.node}.${key}`, numbers: null });
    }
    this.#asked = -Infinity;
    return this.#steered !== null && this.#steered !== undefined;
  }

  #set(image, key, value) {
    const name = `nodes.${image.node}.${key}`, known = this.#known.get(name);
    const wanted = clamp(value, known.low, known.high);
    if (wanted === known.value) return;
    known.value = wanted;
    this.#asked = performance.now();
    this.#send({ kind: "set", name, numbers: [wanted] });
  }
}
