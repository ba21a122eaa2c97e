// Connect to the run: show pictures on the wall and numbers in the readout, send commands back.

import { Bookmarks } from "./bookmarks.js";
import { Choices } from "./choices.js";
import { Compare } from "./compare.js";
import { Display } from "./display.js";
import { Handles } from "./handles.js";
import { Overlay } from "./overlay.js";
import { unpack } from "./painter.js";
import { Parameters } from "./parameters.js";
import { Readout, short } from "./readout.js";
import { Solo } from "./solo.js";
import { Steering } from "./steering.js";
import { Viewports } from "./viewports.js";
import { Wall } from "./wall.js";
import { Zoomed } from "./zoomed.js";

const HEADER_BYTES = 20;          // wall/display/stream.py, HEADER,
const FORMAT = 4;                 // and FORMAT
const [STATISTICS, SAMPLES] = ["S", "N"].map((letter) => letter.charCodeAt(0));  // second byte of a message; tiles: "P"
const SILENT_MS = 3000;           // status comes four times a second; this long without any is a lost connection
const RETRY_MS = [250, 500, 1000, 2000];
const TOO_MANY = 1013;
const ENDED = 1001;
const OWN = new Set(["shown", "overlay", "display"]);   // messages that change nothing for others

const wall = new Wall(
  document.getElementById("wall"), document.getElementById("room"), document.getElementById("controls"));
const readout = new Readout((panel) => wall.point(panel));
const steering = new Steering(document.getElementById("wall"), (command) => send(command), () => wall.height());

let socket = null;
let attempts = 0;
let heard = 0;
let ended = false;
let selected = [];                // by view: the object that is
let steers = true;                // else the server takes OWN messages alone

const viewports = new Viewports(wall);
const compare = new Compare(wall, (command) => send(command), (name) => readout.sampler(name));
const panel = document.getElementById("parameters");
const groups = document.getElementById("parameter-groups");
const parameters = new Parameters(panel, groups, (command) => send(command));
const handles = new Handles(wall, (name, numbers) => send({ kind: "set", name, numbers }));
const focusButton = document.getElementById("focus");
const display = new Display(wall, (name) => send({ kind: "display", value: name }));
const bookmarks = new Bookmarks(
  document.getElementById("bookmarks"), document.getElementById("keep"), (command) => send(command));
const zoomed = new Zoomed((command) => send(command));
const solo = new Solo(wall);
const choices = new Choices(
  ...["choices", "choice-list", "choice-words"].map((id) => document.getElementById(id)), (request) => send(request));
const overlay = new Overlay(wall, (name) => send({ kind: "overlay", value: name }));

function send(message) {
  if (!steers && !OWN.has(message.kind)) return;
  if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
}

function connect() {
  const mine = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/stream`);
  mine.binaryType = "arraybuffer";
  socket = mine;
  heard = performance.now();
  const pictures = new Pictures(mine);
  mine.onmessage = ({ data }) => {
    heard = performance.now();
    if (data instanceof ArrayBuffer) takeBytes(data, pictures);
    else take(JSON.parse(data), pictures);
  };
  mine.onclose = (event) => { if (socket === mine) lost(event.code); };
}

// A page that was left open while the wall was renewed cannot read what comes, and loads itself anew.
// It hears no more until then: a second reload would end the first.
function takeBytes(data, pictures) {
  const [, kind, format] = new Uint8Array(data, 0, 3);
  if (format !== FORMAT) {
    socket.onmessage = null;
    location.reload();
  } else if (kind === STATISTICS) {
    overlay.take(data);
  } else {
    pictures.panel(data);
  }
}

function take(message, pictures) {
  if (message.kind === "layout") {
    attempts = 0;
    ended = false;
    allow(true);
    wall.build(message);
    viewports.build(message);
    zoomed.build(message);
    handles.show({ places: [] });                              // until the run says it anew
    readout.connected();
    display.build(message);
    readout.size(message);
    solo.build(message);
    if (overlay.name) overlay.repeat();
  } else if (message.kind === "access") {
    allow(message.steers);
  } else if (message.kind === "picture") {
    pictures.begin(message);
  } else if (message.kind === "parameters") {
    parameters.show(message.parameters);
    handles.limit(message.parameters);
    zoomed.follow(message.parameters);
    focusButton.hidden = !message.parameters.some((p) => p.name === "lens.focus");
  } else if (message.kind === "choices") {
    choices.show(message);
  } else if (message.kind === "answer") {
    choices.answer(message);
  } else if (message.kind === "handles") {
    handles.show(message);
  } else if (message.kind === "status") {
    steering.samplers = message.samplers;
    const view = viewports.steered;
    readout.show({
      ...message, sampler: message.view_samplers[view] ?? message.sampler,
      paused: message.view_paused[view] ?? message.paused });
    selected = message.selected;
    parameters.select(selected[view]);
    bookmarks.show(message.bookmarks);
    wall.markStale(message.stale);
    compare.status(message, short);
    display.status(message);
  }
}

function allow(mine) {
  steers = mine;
  document.body.classList.toggle("watching", !steers);
}

function lost(code) {
  const wait = RETRY_MS[Math.min(attempts++, RETRY_MS.length - 1)];
  socket = null;
  choices.lost();
  ended ||= code === ENDED;
  if (ended) readout.ended();
  else if (code === TOO_MANY) readout.lost("Too many viewers are watching this wall. Waiting for a place.");
  else readout.lost("Connection lost. Trying again.");
  setTimeout(connect, wait);
}

setInterval(() => {
  if (socket && performance.now() - heard > SILENT_MS) {
    const silent = socket;
    lost(0);
    silent.close();
  }
}, 500);

// All panels of one picture are shown together; the answer `shown` lets the server send the next one.
class Pictures {
  #socket; #head = null; #panels = []; #drawn = Promise.resolve();

  constructor(socket) { this.#socket = socket; }

  begin(head) {
    this.#head = head;
    this.#panels = [];
  }

  panel(buffer) {
    const view = new DataView(buffer);
    if (view.getUint8(1) === SAMPLES) this.#panels.push({ samples: true, image: unpack(buffer) });
    else this.#panels.push(this.#tiles(buffer, view));
    if (this.#panels.length === this.#head.panels) this.#finish(this.#head, this.#panels);
  }

  #tiles(buffer, view) {
    const tiles = new Uint16Array(buffer, HEADER_BYTES, view.getUint16(10, true));
    const image = createImageBitmap(new Blob([new Uint8Array(buffer, HEADER_BYTES + tiles.byteLength)]));
    return { index: view.getUint16(4, true), second: view.getUint8(3) === 1, tiles, image };
  }

  #finish(head, panels) {
    this.#drawn = this.#drawn.then(async () => {
      const images = await Promise.allSettled(panels.map((p) => p.image));
      await new Promise(requestAnimationFrame);
      images.forEach(({ value }, k) => this.#draw(panels[k], value));
      solo.draw();
      document.body.dataset.picture = head.number;
      if (this.#socket.readyState === WebSocket.OPEN) {
        this.#socket.send(JSON.stringify({ kind: "shown", number: head.number }));
      }
    });
  }

  #draw({ index, second, tiles, samples }, image) {
    if (!image) return;                                        // it could not be decoded
    if (samples) {
      display.samples(image);
      return;
    }
    wall.draw(index, image, second, tiles);
    if (!second) display.image(index);
  }
}

// Alt and click, or the button and then a click, focuses at what is shown there. Returns whether the click was for that.
function focusAt(event) {
  if (focusButton.hidden || !(aiming() || event.altKey)) return false;
  const place = wall.at(event.clientX, event.clientY);
  if (place) send({ kind: "focus", ...place });
  if (aiming()) toggleFocus();
  return true;
}

function aiming() { return focusButton.getAttribute("aria-pressed") === "true"; }

function toggleFocus() {
  const aims = !aiming();
  focusButton.setAttribute("aria-pressed", aims);
  document.getElementById("wall").classList.toggle("aiming", aims);
}

// A double click selects an object: the panel of parameters has those of it.
document.getElementById("wall").ondblclick = (event) => select(wall.at(event.clientX, event.clientY));

function select(place) {
  if (!place) return;
  send({ kind: "select", ...place });
  if (groups.hidden) toggleParameters();
}

// Keys do at the middle of the steered view what clicks do elsewhere, and show where that is.
function selectMiddle() {
  if (aiming()) focusMiddle();
  else select(pointAtMiddle());
}

function focusMiddle() {
  if (focusButton.hidden) return;
  const place = pointAtMiddle();
  if (place) send({ kind: "focus", ...place });
  if (aiming()) toggleFocus();
}

function pointAtMiddle() {
  const place = viewports.middle();
  if (place) wall.mark(place);
  return place;
}

// A drag or the wheel steers what is beneath the pointer.
function takeView(event) {
  const place = wall.at(event.clientX, event.clientY);
  if (!place) return;
  viewports.take(place);
  zoomed.take(place);
}

function nextView() {
  zoomed.release();
  if (viewports.several) viewports.next();
}

function toggleDetails() {
  document.body.classList.toggle("bare");
  wall.arrange();
}

function toggleParameters() {
  if (panel.hidden) return;
  groups.hidden = !groups.hidden;
  document.getElementById("parameters-open").setAttribute("aria-expanded", !groups.hidden);
  document.getElementById("details").classList.toggle("editing", !groups.hidden);
}

// While two are compared, another sampler than the adaptive one takes the place at the right.
function choose(name) {
  if (compare.other && name !== "adaptive") {
    compare.with(name);
    return;
  }
  compare.ended();
  steering.sampler(name);
}

const help = document.getElementById("help");
steering.actions = {
  help: () => (help.open ? help.close() : help.showModal()),
  details: toggleDetails,
  fullscreen: () => (document.fullscreenElement ? document.exitFullscreen() : document.body.requestFullscreen()),
  pause: () => readout.pause(),
  sampler: (name) => readout.sampler(name),
  choose,
  compare: () => compare.next(),
  overlay: () => overlay.next(),
  display: () => display.next(),
  parameters: toggleParameters,
  hide: () => parameters.toggleObject(),
  focus: focusAt,
  focusMiddle,
  select: selectMiddle,
  keep: () => bookmarks.keep(),
  recall: () => bookmarks.next(),
  take: takeView,
  image: (dx, dy, factor) => zoomed.move(dx, dy, factor),
  resetImage: () => zoomed.reset(),
  next: nextView,
};
steering.view = () => viewports.steered;
viewports.onsteer = (view) => parameters.select(selected[view]);
steering.several = () => viewports.several;
readout.onpause = () => steering.pause();
readout.onsampler = choose;
document.getElementById("pause").onclick = () => steering.pause();
document.getElementById("reset").onclick = () => steering.reset();
focusButton.onclick = toggleFocus;
document.getElementById("parameters-open").onclick = toggleParameters;
document.getElementById("help-open").onclick = steering.actions.help;
help.onclick = (event) => { if (event.target === help) help.close(); };

connect();
