// Turn pointer, wheel and key input into steering commands: input is summed, and sent once an animation frame.

const MAX_ZOOM = 64, MAX_DRAG = 10;       // what the server takes, wall/geometry/steering.py
const TAP = 0.04;                         // wall heights of one short key press
const HELD_PER_S = 0.9;                   // wall heights a second while a key is held
const KEY_ZOOM = 1.12;
const KEY_STOPS = 1 / 3;                  // of exposure
const KEY_SEEK = 0.5;                     // seconds of one key press, and of each repeat while it is held
const WHEEL_ZOOM = 0.0016;                // log of the factor for one CSS pixel of wheel
const PINCH_WHEEL = 0.01;                 // the same for a touchpad's pinch, which comes as a wheel with ctrl
const LINE_PX = 16, PAGE_PX = 400;
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

const clamp = (x, limit) => Math.max(-limit, Math.min(limit, x));

export class Steering {
  samplers = [];
  actions = {};
  view = () => 0;                         // which one is steered
  several = () => false;                  // whether there are others
  #send; #height; #surface;
  #sum = { orbit: [0, 0], pan: [0, 0], zoom: 1 };
  #due = false; #before = 0;
  #pointers = new Map(); #held = new Set(); #panning = false;

  // `send` takes a command; `height` gives the wall's height in CSS pixels.
  constructor(surface, send, height) {
    this.#send = send;
    this.#height = height;
    this.#surface = surface;
    surface.addEventListener("pointerdown", (e) => this.#down(e));
    surface.addEventListener("pointermove", (e) => this.#move(e));
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
      surface.addEventListener(end, (e) => this.#up(e));
    }
    surface.addEventListener("wheel", (e) => this.#wheel(e), { passive: false });
    surface.addEventListener("contextmenu", (e) => e.preventDefault());
    window.addEventListener("keydown", (e) => this.#key(e));
    window.addEventListener("keyup", (e) => this.#release(e));
    window.addEventListener("blur", () => this.#held.clear());
  }

  pause() {
    this.actions.pause?.();
    this.#time({ kind: "pause" });
  }

  reset() { if (!this.actions.resetImage?.()) this.#steer({ kind: "reset" }); }

  // Of the steered view, or of the one whose time it has.
  #time(command) { this.#send(this.several() ? { ...command, view: this.view() } : command); }

  #steer(command) { this.#send(this.view() ? { ...command, view: this.view() } : command); }

  sampler(name) {
    this.actions.sampler?.(name);
    this.#steer({ kind: "sampler", value: name });
  }

  #add(kind, x, y) {
    this.#sum[kind][0] += x;
    this.#sum[kind][1] += y;
    this.#schedule();
  }

  #zoom(factor) {
    this.#sum.zoom *= factor;
    this.#schedule();
  }

  #schedule() {
    if (this.#due) return;
    this.#due = true;
    requestAnimationFrame((now) => this.#flush(now));
  }

  #flush(now) {
    this.#due = false;
    this.#hold(now);
    const { orbit, pan, zoom } = this.#sum;
    this.#sum = { orbit: [0, 0], pan: [0, 0], zoom: 1 };
    if (this.actions.image?.(orbit[0] + pan[0], orbit[1] + pan[1], zoom)) return;
    if (orbit[0] || orbit[1]) this.#steer({ kind: "orbit", x: clamp(orbit[0], MAX_DRAG), y: clamp(orbit[1], MAX_DRAG) });
    if (pan[0] || pan[1]) this.#steer({ kind: "pan", x: clamp(pan[0], MAX_DRAG), y: clamp(pan[1], MAX_DRAG) });
    if (zoom !== 1) this.#steer({ kind: "zoom", x: Math.max(1 / MAX_ZOOM, Math.min(MAX_ZOOM, zoom)) });
  }

  // Keys that are held move on with the time, not with the keyboard's repeat rate.
  #hold(now) {
    const seconds = this.#before ? Math.min(0.1, (now - this.#before) / 1000) : 0;
    this.#before = this.#held.size ? now : 0;
    for (const key of this.#held) {
      const [x, y] = ARROWS[key];
      this.#add(this.#panning ? "pan" : "orbit", x * HELD_PER_S * seconds, y * HELD_PER_S * seconds);
    }
    if (this.#held.size) this.#schedule();
  }

  #down(e) {
    if (e.pointerType === "mouse" && e.button !== 0 && e.button !== 2) return;
    this.#surface.focus({ preventScroll: true });
    this.#surface.classList.add("by-pointer");               // no ring, until a key is used
    if (e.button === 0 && this.actions.focus?.(e)) {
      e.preventDefault();
      return;
    }
    this.actions.take?.(e);
    this.#surface.setPointerCapture(e.pointerId);
    this.#pointers.set(e.pointerId, { x: e.clientX, y: e.clientY, pan: e.button === 2 });
    this.#surface.classList.add("held");
    e.preventDefault();
  }

  #move(e) {
    const before = this.#pointers.get(e.pointerId);
    if (!before) return;
    const other = [...this.#pointers].find(([id]) => id !== e.pointerId)?.[1];
    const dx = (e.clientX - before.x) / this.#height(), dy = (e.clientY - before.y) / this.#height();
    if (other) {
      const apart = (p) => Math.max(8, Math.hypot(p.x - other.x, p.y - other.y));
      this.#zoom(apart({ x: e.clientX, y: e.clientY }) / apart(before));
      this.#add("pan", dx / 2, dy / 2);
    } else {
      this.#add(before.pan || e.shiftKey ? "pan" : "orbit", dx, dy);
    }
    before.x = e.clientX;
    before.y = e.clientY;
  }

  #up(e) {
    this.#pointers.delete(e.pointerId);
    if (!this.#pointers.size) this.#surface.classList.remove("held");
  }

  #wheel(e) {
    e.preventDefault();
    this.actions.take?.(e);
    const pixels = e.deltaY * [1, LINE_PX, PAGE_PX][e.deltaMode];
    this.#zoom(Math.exp(-clamp(pixels, 400) * (e.ctrlKey ? PINCH_WHEEL : WHEEL_ZOOM)));
  }

  #key(e) {
    this.#surface.classList.remove("by-pointer");
    if (e.ctrlKey || e.metaKey || e.altKey || document.querySelector("dialog[open]") && e.key !== "h") return;
    if (e.target.closest?.("select, input[type=text]")) return;  // all keys are its own
    const onControl = e.target.closest?.("button, input, a");
    const onScroll = e.target.closest?.(".scroll");
    if (e.key in ARROWS && !onScroll && e.target.type !== "radio" && e.target.type !== "range") this.#arrow(e);
    else if (e.key === " " && !onControl && !onScroll) this.pause();
    else if (e.key === "Enter" && !onControl && !onScroll && !e.target.closest?.("[role=slider]"))
      this.actions.select();
    else if (e.key === "+" || e.key === "=") this.#zoom(KEY_ZOOM);
    else if (e.key === "-" || e.key === "_") this.#zoom(1 / KEY_ZOOM);
    else if (e.key === "]") this.#send({ kind: "expose", x: KEY_STOPS });
    else if (e.key === "[") this.#send({ kind: "expose", x: -KEY_STOPS });
    else if (e.key === ".") this.#time({ kind: "seek", x: KEY_SEEK });
    else if (e.key === ",") this.#time({ kind: "seek", x: -KEY_SEEK });
    else if (e.repeat || !this.#letter(e.key)) return;
    e.preventDefault();
  }

  #letter(key) {
    const index = "123456789".indexOf(key);
    if (key && index >= 0 && index < this.samplers.length) this.actions.choose(this.samplers[index]);
    else if (key === "r") this.reset();
    else if (key === "b") this.actions.keep();
    else if (key === "v") this.actions.recall();
    else if (key === "n") this.actions.next();
    else if (key === "l") this.actions.focusMiddle();
    else if (key === "x") this.actions.hide();
    else if (key === "z") this.#send({ kind: "undo" });
    else if (key === "c") this.actions.compare();
    else if (key === "o") this.actions.overlay();
    else if (key === "s") this.actions.display();
    else if (key === "p") this.actions.parameters();
    else if (key === "h" || key === "?") this.actions.help();
    else if (key === "d") this.actions.details();
    else if (key === "f") this.actions.fullscreen();
    else return false;
    return true;
  }

  #arrow(e) {
    this.#panning = e.shiftKey;
    if (e.repeat || this.#held.has(e.key)) return;
    const [x, y] = ARROWS[e.key];
    this.#held.add(e.key);
    this.#add(e.shiftKey ? "pan" : "orbit", x * TAP, y * TAP);
  }

  #release(e) {
    this.#held.delete(e.key);
    if (e.key === "Shift") this.#panning = false;
  }
}
