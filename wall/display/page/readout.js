// Numbers on the page: state, facts, table of ranks, latency plot.

import { check, fill } from "./choice.js";

const STALE_S = 3;                // a displayed sample older than this is marked
const BUSY_S = 1;                 // one piece of work holds a rank up for so long: it is said
const STUCK_MS = 2500;            // the run's own clock stands still this long: it does not answer
const TRUST_MS = 700;             // what was just asked for is shown until the run had time to say so itself
const NONE = "–";
const INCH = 0.0254;              // metres

const $ = (id) => document.getElementById(id);
const isNumber = (x) => typeof x === "number" && Number.isFinite(x);

export function short(value) {
  if (!isNumber(value)) return NONE;
  for (const [unit, letter] of [[1e9, " G"], [1e6, " M"], [1e3, " k"]]) {
    if (Math.abs(value) >= unit * 0.9995) return digits(value / unit) + letter;
  }
  return digits(value);
}

const digits = (x) => x.toFixed(x === 0 || Math.abs(x) >= 99.95 ? 0 : Math.abs(x) >= 9.995 ? 1 : 2);

// As exact as anyone can use.
const millis = (ms) => (ms >= 999.5 ? `${digits(ms / 1000)} s` : `${ms < 9.95 ? ms.toFixed(1) : Math.round(ms)} ms`);

function age(seconds) {
  if (!isNumber(seconds)) return NONE;
  if (seconds >= 99.5) return `${Math.round(seconds / 60)} min`;
  return seconds >= 0.9995 ? `${seconds.toFixed(1)} s` : `${Math.round(seconds * 1000)} ms`;
}

function clock(seconds) {
  const s = Math.floor(seconds);
  const two = (n) => String(n).padStart(2, "0");
  return s < 3600 ? `${Math.floor(s / 60)}:${two(s % 60)}`
    : `${Math.floor(s / 3600)}:${two(Math.floor(s / 60) % 60)}:${two(s % 60)}`;
}

function write(element, text) { if (element.textContent !== text) element.textContent = text; }

export class Readout {
  onsampler = () => {};
  #point; #rows = []; #samplers = ""; #status = null;
  #asked = { pause: -Infinity, sampler: -Infinity };
  #seconds = -1; #advanced = 0; #connected = false;

  // `point` is called with a panel id while its row is pointed at, and with null after.
  constructor(point) {
    this.#point = point;
    new ResizeObserver(() => this.#plot()).observe($("plot"));
  }

  connected() {
    this.#advanced = performance.now();
    this.#connect(true);
    this.#banner(null);
  }

  lost(text) {
    this.#connect(false);
    document.body.dataset.state = "lost";
    write($("state"), "Not connected");
    this.#banner(text);
  }

  ended() {
    this.#connect(false);
    document.body.dataset.state = "ended";
    write($("state"), "Ended");
    this.#banner("The run has ended. This is its last picture.");
  }

  // How large the wall is, metres, and how fine: `pitch` is metres a pixel, across and down.
  size({ metres, panels }) {
    const pitches = panels.flatMap(({ pitch }) => pitch);
    const [least, most] = [Math.max(...pitches), Math.min(...pitches)].map((pitch) => Math.round(INCH / pitch));
    write($("fact-wall"), `${metres.map(digits).join(" × ")} m, ${least < most ? `${least} to ` : ""}${most} dpi`);
  }

  // Without a run there is nothing to pause, and no wall to save.
  #connect(connected) {
    this.#connected = connected;
    $("pause").disabled = $("reset").disabled = $("keep").disabled = !connected;
    $("screenshot").hidden = !connected;
  }

  pause() {
    if (!this.#connected) return;
    this.#asked.pause = performance.now();
    this.#showPaused($("pause").getAttribute("aria-pressed") !== "true");
  }

  sampler(name) {
    this.#asked.sampler = performance.now();
    this.#showSampler(name);
  }

  show(status) {
    const now = performance.now();
    this.#status = status;
    if (status.seconds !== this.#seconds) this.#advanced = now;
    this.#seconds = status.seconds;
    this.#banner(now - this.#advanced > STUCK_MS ? "The run does not answer. The last picture stays." : null);
    this.#buildSamplers(status.samplers);
    if (now - this.#asked.pause > TRUST_MS) this.#showPaused(status.paused);
    if (now - this.#asked.sampler > TRUST_MS) this.#showSampler(status.compare || status.sampler);
    write($("fact-time"), clock(status.seconds));
    const rests = status.paused ? "paused" : "at rest";
    write($("fact-refresh"), status.refreshes_per_s > 0 ? `${digits(status.refreshes_per_s)} Hz` : rests);
    write($("fact-right"), status.right_ms > 0 ? millis(status.right_ms) : NONE);
    $("slow").hidden = !status.slow;
    write($("slow"), status.slow);
    $("notes").hidden = !status.notes.length;
    write($("notes"), status.notes.join("\n"));
    write($("fact-samples"), `${short(status.ranks.reduce((sum, r) => sum + (r.samples_per_s || 0), 0))}/s`);
    $("fact-stages").hidden = !status.samples_per_pixel;
    write($("fact-stage"), `${status.samples_per_pixel} a pixel${status.error ? `, ± ${digits(status.error)}` : ""}`);
    this.#showRanks(status.ranks);
    this.#showLatency(status);
  }

  #banner(text) {
    $("banner").hidden = !text;
    if (text) write($("banner"), text);
  }

  #showPaused(paused) {
    document.body.dataset.state = paused ? "paused" : "live";
    write($("state"), `${paused ? "Paused" : "Live"}${document.body.classList.contains("watching") ? ", to watch only" : ""}`);
    $("pause").setAttribute("aria-pressed", paused);
    write($("pause-word"), paused ? "Go on" : "Pause");
  }

  #buildSamplers(names) {
    if (names.join() === this.#samplers) return;
    this.#samplers = names.join();
    fill($("samplers"), "sampler", names, (name, k) => `Sampler ${name} (${k + 1})`, (name) => this.onsampler(name));
  }

  #showSampler(name) {
    check($("samplers"), name);
  }

  #showRanks(ranks) {
    if (this.#rows.length !== ranks.length) this.#buildRows(ranks.length);
    ranks.forEach((rank, k) => this.#fill(this.#rows[k], rank));
    const busy = ranks.filter((r) => r.busy_s >= BUSY_S).length;
    const lost = ranks.filter((r) => !r.alive && r.busy_s < BUSY_S).length;
    const bad = [lost && `${lost} of ${ranks.length} lost`, busy && `${busy} of ${ranks.length} busy`].filter(Boolean);
    write($("ranks-note"), bad.join(", ") || `${ranks.length} alive`);
    $("ranks-note").classList.toggle("bad", lost > 0);
  }

  #buildRows(count) {
    this.#rows = Array.from({ length: count }, () => {
      const row = document.createElement("tr");
      row.innerHTML = '<th scope="row"><i class="dot" aria-hidden="true"></i><b></b> <span></span></th>'
        + '<td class="number"></td>'.repeat(5);
      row.onpointerenter = () => this.#point(row.dataset.panel);
      row.onpointerleave = () => this.#point(null);
      return row;
    });
    $("ranks").replaceChildren(...this.#rows);
  }

  #fill(row, rank) {
    const [head, samples, bytes, oldest, drops, memory] = row.cells;
    const renders = rank.role === "renderer";
    row.dataset.panel = rank.panel;
    row.className = rank.alive ? "" : "lost";
    const state = rank.busy_s >= BUSY_S ? `busy ${age(rank.busy_s)}` : rank.alive ? "" : "lost";
    row.title = `Rank ${rank.rank}, ${rank.role}, ${state || "alive"}: ${rank.region}`;
    write(head.children[1], String(rank.rank));
    write(head.children[2], `${rank.panel || rank.role} ${state}`.trim());
    write(samples, renders ? short(rank.samples_per_s) : NONE);
    write(bytes, renders ? short(rank.bytes_per_s) : NONE);
    write(oldest, renders ? age(rank.oldest_sample_s) : NONE);
    oldest.classList.toggle("warn", rank.oldest_sample_s > STALE_S && !this.#status.paused);
    write(drops, rank.dropped < 1000 ? String(rank.dropped) : short(rank.dropped));
    drops.classList.toggle("warn", rank.dropped > 0);
    write(memory, rank.memory_mb > 0 ? `${Math.round(rank.memory_mb)} MB` : NONE);
  }

  #showLatency({ latency_ms: ms, latencies_ms: recent }) {
    const known = recent.length > 0;
    ["p50", "p95", "p99"].forEach((id, k) => write($(id), known ? millis(ms[k]) : NONE));
    $("plot").setAttribute("aria-label", known
      ? `Latency of the last ${recent.length} inputs: median ${millis(ms[0])}, 95 % below ${millis(ms[1])}`
      : "Latency: no input yet");
    this.#plot();
  }

  #plot() {
    const canvas = $("plot"), ratio = window.devicePixelRatio || 1;
    const w = canvas.clientWidth, h = canvas.clientHeight;
    if (!this.#status || !w || !h) return;
    canvas.width = Math.round(w * ratio);
    canvas.height = Math.round(h * ratio);
    const c = canvas.getContext("2d");
    c.scale(ratio, ratio);
    drawLatency(c, { w, h, recent: this.#status.latencies_ms, marks: this.#status.latency_ms });
  }
}

// One bar an input, newest at the right; the three percentiles as lines.
function drawLatency(c, { w, h, recent, marks }) {
  const style = getComputedStyle(document.documentElement);
  const color = (name) => style.getPropertyValue(name).trim();
  const axis = 3 * parseFloat(style.getPropertyValue("--small")) + 1, base = h - 0.5, STEP = 4, BAR = 3;
  c.font = `${style.getPropertyValue("--small")} ${style.getPropertyValue("--sans")}`;
  c.textBaseline = "middle";
  if (!recent.length) {
    c.fillStyle = color("--muted");
    c.textAlign = "center";
    c.fillText("move the wall to measure", w / 2, h / 2);
    return;
  }
  const bars = recent.slice(-Math.floor((w - axis) / STEP));
  const top = niceAbove(Math.max(marks[2], ...bars));
  const y = (ms) => base - (ms / top) * (h - 8);
  grid(c, { w, axis, top, y, color });
  bars.forEach((ms, k) => {
    c.fillStyle = color(ms > marks[1] ? "--amber" : "--accent");
    c.globalAlpha = 0.35 + 0.65 * ((k + 1) / bars.length);
    c.fillRect(w - (bars.length - k) * STEP, y(ms), BAR, base - y(ms));
  });
  c.globalAlpha = 1;
  c.setLineDash([2, 3]);
  c.strokeStyle = color("--text");
  line(c, axis, w, y(marks[0]));
  c.setLineDash([]);
}

function grid(c, { w, axis, top, y, color }) {
  c.strokeStyle = color("--line");
  c.fillStyle = color("--muted");
  c.textAlign = "right";
  for (const ms of [0, top / 2, top]) {
    line(c, axis, w, y(ms));
    c.fillText(ms === 0 ? "0" : `${ms}`, axis - 8, Math.min(Math.max(y(ms), 7), y(0) - 5));
  }
}

function line(c, x0, x1, y) {
  c.beginPath();
  c.moveTo(x0, Math.round(y) - 0.5);
  c.lineTo(x1, Math.round(y) - 0.5);
  c.stroke();
}

function niceAbove(ms) {
  const unit = 10 ** Math.floor(Math.log10(Math.max(ms, 1)));
  return unit * [1, 2, 4, 5, 6, 8, 10].find((k) => k * unit >= ms);
}
