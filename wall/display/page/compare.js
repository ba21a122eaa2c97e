// Compare two samplers that share the rays: the adaptive one at the left, another at the right.

const ADAPTIVE = "adaptive";
const USUAL = "frameless";        // compared with the adaptive one if nobody says otherwise
const TRUST_MS = 700;             // what was just asked for is shown until the run had time to say so itself
const KEY_STEP = 0.02;            // of the wall's width
const TAG_EDGE_PX = 14;           // page.css, .tag
const VIEWS = ["single", "wipe", "beside"];

const $ = (id) => document.getElementById(id);

export class Compare {
  other = "";                     // the sampler at the right; "" when there is one view of one
  #wall; #send; #tell; #kind = "wipe"; #last = USUAL; #asked = -Infinity; #divider = $("divider"); #at = 0.5;

  // `send` takes a command; `asked` is called with the name of the sampler that is to stand at the right.
  constructor(wall, send, asked) {
    this.#tell = asked;
    this.#wall = wall;
    this.#send = send;
    for (const input of $("views").querySelectorAll("input")) input.onchange = () => this.view(input.value);
    this.#divider.addEventListener("pointerdown", (e) => this.#grab(e));
    this.#divider.addEventListener("pointermove", (e) => this.#drag(e));
    this.#divider.addEventListener("lostpointercapture", () => this.#divider.classList.remove("held"));
    this.#divider.addEventListener("keydown", (e) => this.#key(e));
    this.#move(0.5);
    this.#show();
  }

  // "single", "wipe" or "beside"
  view(name) {
    if (name !== "single") this.#kind = name;
    this.#want(name === "single" ? "" : this.other || this.#last);
  }

  next() { this.view(VIEWS[(VIEWS.indexOf(this.#view()) + 1) % VIEWS.length]); }

  // Put another sampler at the right.
  with(name) { this.#want(name); }

  // One sampler was chosen: the run ends the comparison itself.
  ended() {
    this.#asked = performance.now();
    this.other = "";
    this.#show();
  }

  status({ sampler, compare, samplers, ranks, compared_per_s: theirs }, short) {
    this.#last = this.other || (sampler !== ADAPTIVE && samplers.includes(sampler) ? sampler : this.#last);
    if (performance.now() - this.#asked > TRUST_MS && compare !== this.other) {
      this.other = compare;
      this.#show();
    }
    const all = ranks.reduce((sum, r) => sum + (r.samples_per_s || 0), 0);
    $("left-rate").textContent = `${short(Math.max(0, all - theirs))}/s`;
    $("right-rate").textContent = `${short(theirs)}/s`;
    this.#hideCrowded();
  }

  #want(other) {
    this.#asked = performance.now();
    if (other !== this.other) this.#send({ kind: "compare", value: other });
    this.other = other;
    if (other) this.#tell(other);
    this.#show();
  }

  #view() { return this.other ? this.#kind : "single"; }

  #show() {
    const view = this.#view();
    for (const input of $("views").querySelectorAll("input")) input.checked = input.value === view;
    document.body.dataset.view = view;
    document.body.dataset.other = this.other;
    for (const id of ["left-tag", "right-tag"]) $(id).hidden = view === "single";
    $("left-name").textContent = ADAPTIVE;
    $("right-name").textContent = this.other;
    this.#divider.hidden = view !== "wipe";
    this.#wall.show(view);
    this.#hideCrowded();
  }

  // A side that is narrower than its name shows none.
  #hideCrowded() {
    const width = this.#divider.parentElement.clientWidth;
    for (const [id, share] of [["left-tag", this.#at], ["right-tag", 1 - this.#at]]) {
      const crowded = this.#view() === "wipe" && share * width < $(id).offsetWidth + 2 * TAG_EDGE_PX;
      $(id).classList.toggle("crowded", crowded);
    }
  }

  #grab(e) {
    if (e.pointerType === "mouse" && e.button !== 0) return;
    this.#divider.setPointerCapture(e.pointerId);
    this.#divider.classList.add("held");
    this.#divider.focus({ preventScroll: true });
    e.preventDefault();
    e.stopPropagation();                                       // the wall is not to turn
  }

  #drag(e) {
    e.stopPropagation();
    if (!this.#divider.hasPointerCapture(e.pointerId)) return;
    const box = this.#divider.parentElement.getBoundingClientRect();
    this.#move((e.clientX - box.left) / box.width);
  }

  #key(e) {
    const step = { ArrowLeft: -KEY_STEP, ArrowRight: KEY_STEP, Home: -1, End: 1 }[e.key];
    if (step === undefined) return;
    this.#move(this.#at + step);
    e.preventDefault();
    e.stopPropagation();
  }

  #move(at) {
    this.#at = Math.min(Math.max(at, 0), 1);
    this.#divider.parentElement.style.setProperty("--wipe", `${100 * this.#at}%`);
    this.#divider.setAttribute("aria-valuenow", Math.round(100 * this.#at));
    this.#hideCrowded();
  }
}
