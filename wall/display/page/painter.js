// Make panels' images of samples with WebGL2: a display that takes in samples in any order and keeps them.
//
// Each panel has a texture of the newest sample of each pixel, painted as points. The depth buffer holds how new each
// is: an older one that comes late stays behind. Light is kept as the bits of half floats, and a table of all of them
// says which byte each shows as, so that no arithmetic of the GPU decides about a byte. Only a tone mapping that takes
// the three channels together is the GPU's: what it makes of them is looked up likewise.

import { COVER, contextOf, program, texture } from "./webgl.js";

const HEADER_BYTES = 20;          // wall/display/stream.py, SAMPLES_HEADER,
const COUNTS_BYTES = 16;          // SAMPLES_COUNTS
const MORE = 255;                 // and MORE
const CURVE_STEPS = 4096;         // wall/core/colour.py
const INFINITE = 0x7c00;          // bits of the half float above all others
const TABLE = [256, 125];         // texels for 31,745 halves, low byte of the bits across
const MAPPINGS = { none: 0, reinhard: 1, aces: 2, neutral: 3 };   // wall/core/kernels/tone_mapping.py, and its curves
const BRIGHTEST = 1e6;
const NEWEST = 2 ** 23;           // versions that a depth of 24 bits tells apart

const POINTS = `#version 300 es
layout(location = 0) in uint pixel;
layout(location = 1) in uvec3 light;
uniform ivec2 size;
uniform float depth;
flat out uvec3 kept;
void main() {
  ivec2 place = ivec2(int(pixel) % size.x, int(pixel) / size.x);
  kept = light;
  gl_PointSize = 1.0;
  gl_Position = vec4((2.0 * vec2(place) + 1.0) / vec2(size) - 1.0, depth, 1.0);
}`;
const KEEP = `#version 300 es
precision highp float; precision highp int;
flat in uvec3 kept;
out uvec4 sampled;
void main() { sampled = uvec4(kept, 0u); }`;
const SHOW = `#version 300 es
precision highp float; precision highp int; precision highp usampler2D;
uniform usampler2D samples, codes;
uniform ivec2 size;
uniform float gain;
uniform bool together;
out vec4 colour;
float shown(uint bits) { return float(texelFetch(codes, ivec2(bits & 255u, bits >> 8), 0).r) / 255.0; }
vec3 neutral(vec3 light) {
  float least = min(light.r, min(light.g, light.b));
  light -= least < 0.08 ? least - 6.25 * least * least : 0.04;
  float peak = max(light.r, max(light.g, light.b));
  if (peak < 0.76) return light;
  float brought = 1.0 - 0.24 * 0.24 / (peak + 0.24 - 0.76);
  return mix(light * (brought / peak), vec3(brought), 1.0 - 1.0 / (0.15 * (peak - brought) + 1.0));
}
uint bitsOf(float light) { return packHalf2x16(vec2(light, 0.0)) & 0xffffu; }
void main() {
  uvec4 light = texelFetch(samples, ivec2(gl_FragCoord.x, size.y - 1 - int(gl_FragCoord.y)), 0);
  if (together) {
    vec3 exposed = gain * vec3(unpackHalf2x16(light.r).x, unpackHalf2x16(light.g).x, unpackHalf2x16(light.b).x);
    vec3 mapped = clamp(neutral(min(exposed, 1e6)), 0.0, 1.0);
    light.rgb = uvec3(bitsOf(mapped.r), bitsOf(mapped.g), bitsOf(mapped.b));
  }
  colour = vec4(shown(light.r), shown(light.g), shown(light.b), 1.0);
}`;

export class Painter {
  onlost = () => {};
  #gl; #canvas; #keep; #show; #buffer; #panels = new Map();

  // Throws an Error where the browser lacks what it takes.
  constructor() {
    this.#canvas = document.createElement("canvas");
    const gl = contextOf(this.#canvas);
    if (!window.DecompressionStream) throw new Error("no DecompressionStream");
    this.#canvas.addEventListener("webglcontextlost", () => this.onlost());
    this.#gl = gl;
    this.#keep = program(gl, POINTS, KEEP);
    this.#show = program(gl, COVER, SHOW);
    this.#buffer = gl.createBuffer();
    gl.depthFunc(gl.GEQUAL);
  }

  close() {
    this.onlost = () => {};
    this.#gl.getExtension("WEBGL_lose_context")?.loseContext();
  }

  // Paint samples that `unpack` gave: a panel's first ones are of all of it. Returns whether there is such a panel.
  take({ index, width, height, version, gain, mapping, pixels, light, whole }) {
    let panel = this.#panels.get(index);
    if (!panel && !whole) return false;                        // of before this page began anew
    if (whole) {
      if (panel) this.#forget(panel);
      this.#panels.set(index, panel = this.#make(width, height, version));
    }
    if (panel.gain !== gain || panel.mapping !== mapping) this.#expose(panel, gain, mapping);
    this.#paint(panel, pixels, light, version);
    return true;
  }

  // Draw a panel as it is now over a 2D canvas of its size.
  draw(index, context) {
    const gl = this.#gl, { width, height, texture, codes, gain, mapping } = this.#panels.get(index);
    if (this.#canvas.width !== width) this.#canvas.width = width;
    if (this.#canvas.height !== height) this.#canvas.height = height;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, width, height);
    gl.disable(gl.DEPTH_TEST);
    gl.useProgram(this.#show.program);
    gl.uniform2i(this.#show.at("size"), width, height);
    gl.uniform1f(this.#show.at("gain"), gain);
    gl.uniform1i(this.#show.at("together"), mapping === MAPPINGS.neutral);
    [[texture, "samples"], [codes, "codes"]].forEach(([bound, name], unit) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, bound);
      gl.uniform1i(this.#show.at(name), unit);
    });
    gl.disableVertexAttribArray(0);
    gl.disableVertexAttribArray(1);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    context.drawImage(this.#canvas, 0, 0);
  }

  #paint(panel, pixels, light, version) {
    const gl = this.#gl;
    gl.bindFramebuffer(gl.FRAMEBUFFER, panel.frame);
    gl.viewport(0, 0, panel.width, panel.height);
    gl.enable(gl.DEPTH_TEST);
    let newness = (version - panel.first + NEWEST / 2) >>> 0;   // an early one may be older than the first that came
    if (newness >= NEWEST) {
      gl.clearBufferfv(gl.DEPTH, 0, [0]);
      panel.first = version;
      newness = NEWEST / 2;
    }
    gl.useProgram(this.#keep.program);
    gl.uniform2i(this.#keep.at("size"), panel.width, panel.height);
    gl.uniform1f(this.#keep.at("depth"), (2 * newness) / NEWEST - 1);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.#buffer);
    gl.bufferData(gl.ARRAY_BUFFER, pixels.byteLength + light.byteLength, gl.STREAM_DRAW);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, pixels);
    gl.bufferSubData(gl.ARRAY_BUFFER, pixels.byteLength, light);
    gl.enableVertexAttribArray(0);
    gl.enableVertexAttribArray(1);
    gl.vertexAttribIPointer(0, 1, gl.UNSIGNED_INT, 0, 0);
    gl.vertexAttribIPointer(1, 3, gl.UNSIGNED_SHORT, 0, pixels.byteLength);
    gl.drawArrays(gl.POINTS, 0, pixels.length);
  }

  #make(width, height, version) {
    const gl = this.#gl, panel = { width, height, first: version, gain: undefined };
    panel.texture = stored(gl, gl.RGBA16UI, width, height);
    panel.codes = stored(gl, gl.R8UI, ...TABLE);
    panel.frame = gl.createFramebuffer();
    panel.depth = gl.createRenderbuffer();
    gl.bindRenderbuffer(gl.RENDERBUFFER, panel.depth);
    gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT24, width, height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, panel.frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, panel.texture, 0);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, panel.depth);
    gl.clearBufferuiv(gl.COLOR, 0, [0, 0, 0, 0]);
    gl.clearBufferfv(gl.DEPTH, 0, [0]);
    return panel;
  }

  #forget({ texture, codes, frame, depth }) {
    const gl = this.#gl;
    gl.deleteTexture(texture);
    gl.deleteTexture(codes);
    gl.deleteFramebuffer(frame);
    gl.deleteRenderbuffer(depth);
  }

  #expose(panel, gain, mapping) {
    const gl = this.#gl, codes = new Uint8Array(TABLE[0] * TABLE[1]);
    codes.set(mapping === MAPPINGS.neutral ? codesOfHalves(1, MAPPINGS.none) : codesOfHalves(gain, mapping));
    gl.bindTexture(gl.TEXTURE_2D, panel.codes);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, ...TABLE, gl.RED_INTEGER, gl.UNSIGNED_BYTE, codes);
    Object.assign(panel, { gain, mapping });
  }
}

// What a message says: see wall/display/stream.py, encode_samples.
export async function unpack(message) {
  const deflated = new Blob([new Uint8Array(message, HEADER_BYTES)]).stream();
  const body = await new Response(deflated.pipeThrough(new DecompressionStream("deflate"))).arrayBuffer();
  const head = new DataView(message), counts = new DataView(body), count = counts.getUint32(8, true);
  const coded = counts.getUint32(12, true), whole = coded === 0 && count > 0, pixels = new Uint32Array(count);
  const steps = new Uint8Array(body, COUNTS_BYTES + 6 * count, coded);
  if (whole) for (let k = 0; k < count; k++) pixels[k] = k;
  for (let k = 0, n = 0, pixel = -1; k < coded; k++) {
    pixel += steps[k];
    if (steps[k] < MORE) pixels[n++] = pixel;
  }
  return {
    index: head.getUint16(4, true), width: head.getUint16(6, true), height: head.getUint16(8, true),
    version: head.getUint32(12, true), gain: counts.getFloat32(0, true), mapping: counts.getUint8(4), pixels,
    light: new Uint16Array(body, COUNTS_BYTES, 3 * count), whole,
  };
}

// (31745) byte that each half float from 0 to infinity shows as; float32 in every step, as wall/display/sample_store.py.
export function codesOfHalves(gain, mapping) {
  const curve = Uint8Array.from({ length: CURVE_STEPS + 1 }, (_, k) => Math.round(255 * srgb((k / CURVE_STEPS) ** 2)));
  return Uint8Array.from({ length: INFINITE + 1 }, (_, bits) => {
    const exposed = Math.min(mapped(Math.fround(gain * halfOf(bits)), mapping), 1);
    return curve[Math.floor(Math.fround(Math.fround(Math.sqrt(exposed)) * CURVE_STEPS + 0.5))];
  });
}

// One channel of exposed light, under a curve that takes each by itself.
function mapped(light, mapping) {
  const f = Math.fround, x = mapping === MAPPINGS.none ? light : Math.min(light, BRIGHTEST);
  if (mapping === MAPPINGS.reinhard) return f(x / f(1 + x));
  if (mapping !== MAPPINGS.aces) return x;
  const above = f(x * f(f(f(2.51) * x) + f(0.03)));
  return f(above / f(f(x * f(f(f(2.43) * x) + f(0.59))) + f(0.14)));
}

const srgb = (x) => (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055);

function halfOf(bits) {
  const exponent = bits >> 10, mantissa = bits & 1023;
  if (exponent === 31) return Infinity;
  return exponent ? (1 + mantissa / 1024) * 2 ** (exponent - 15) : mantissa * 2 ** -24;
}

// Of one size for good.
function stored(gl, format, width, height) {
  const made = texture(gl, gl.TEXTURE_2D);
  gl.texStorage2D(gl.TEXTURE_2D, 1, format, width, height);
  return made;
}
