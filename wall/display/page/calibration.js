// Show a panel's image as its display needs it: table(gain light^gamma), see wall/operators/colour.py. With WebGL2.

import { COVER, contextOf, program, texture } from "./webgl.js";

const NODES_BYTES = 28;           // wall/display/stream.py, TABLE_HEADER

const GRADE = `#version 300 es
precision highp float; precision highp int; precision highp sampler2D; precision highp sampler3D;
uniform sampler2D image;
uniform sampler3D nodes;
uniform vec3 gain, low, high;
uniform float gamma;
uniform int count;                // of nodes along an edge of the table; 0: no table
out vec4 colour;
vec3 light(vec3 x) { return mix(x / 12.92, pow((x + 0.055) / 1.055, vec3(2.4)), step(0.04045, x)); }
vec3 shown(vec3 x) { return mix(12.92 * x, 1.055 * pow(x, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, x)); }
vec3 node(ivec3 k) { return texelFetch(nodes, k, 0).rgb; }

// Along the edges of the cell from its darkest node to its lightest, the axis of the largest fraction first.
vec3 along(ivec3 k, ivec3 first, ivec3 second, float a, float b, float c) {
  return (1.0 - a) * node(k) + (a - b) * node(k + first) + (b - c) * node(k + first + second) + c * node(k + 1);
}
vec3 table(vec3 x) {
  const ivec3 R = ivec3(1, 0, 0), G = ivec3(0, 1, 0), B = ivec3(0, 0, 1);
  vec3 place = clamp((x - low) / (high - low), 0.0, 1.0) * float(count - 1);
  ivec3 k = min(ivec3(place), count - 2);
  vec3 f = place - vec3(k);
  if (f.r >= f.g) {
    if (f.g >= f.b) return along(k, R, G, f.r, f.g, f.b);
    return f.r >= f.b ? along(k, R, B, f.r, f.b, f.g) : along(k, B, R, f.b, f.r, f.g);
  }
  if (f.b >= f.g) return along(k, B, G, f.b, f.g, f.r);
  return f.b >= f.r ? along(k, G, B, f.g, f.b, f.r) : along(k, G, R, f.g, f.r, f.b);
}

void main() {
  vec3 x = texelFetch(image, ivec2(gl_FragCoord.x, textureSize(image, 0).y - 1 - int(gl_FragCoord.y)), 0).rgb;
  x = shown(clamp(gain * pow(light(x), vec3(gamma)), 0.0, 1.0));
  colour = vec4(count > 0 ? clamp(table(x), 0.0, 1.0) : x, 1.0);
}`;

export class Calibration {
  canvas = document.createElement("canvas");
  #gl; #image; #at;

  // `colour` of the layout; `table`: what the wall's /table/ID holds, null where there is none. Throws without WebGL2.
  constructor({ gain, gamma }, table) {
    const gl = this.#gl = contextOf(this.canvas), { program: made, at } = program(gl, COVER, GRADE);
    gl.useProgram(made);
    this.#at = at;
    gl.uniform3fv(this.#at("gain"), gain);
    gl.uniform1f(this.#at("gamma"), gamma);
    gl.uniform1i(this.#at("nodes"), 1);
    gl.activeTexture(gl.TEXTURE1);
    this.#load(table ?? new Float32Array([1, 0, 0, 0, 1, 1, 1, 0, 0, 0]).buffer, table !== null);
    gl.activeTexture(gl.TEXTURE0);
    this.#image = texture(gl, gl.TEXTURE_2D);
  }

  // Draw what a canvas shows.
  draw(source) {
    const gl = this.#gl;
    if (this.canvas.width !== source.width) this.canvas.width = source.width;
    if (this.canvas.height !== source.height) this.canvas.height = source.height;
    gl.viewport(0, 0, source.width, source.height);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, source);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  #load(bytes, used) {
    const gl = this.#gl, count = used ? new DataView(bytes).getUint32(0, true) : 1;
    gl.uniform1i(this.#at("count"), used ? count : 0);
    gl.uniform3fv(this.#at("low"), new Float32Array(bytes, 4, 3));
    gl.uniform3fv(this.#at("high"), new Float32Array(bytes, 16, 3));
    texture(gl, gl.TEXTURE_3D);
    gl.texImage3D(
      gl.TEXTURE_3D, 0, gl.RGB32F, count, count, count, 0, gl.RGB, gl.FLOAT, new Float32Array(bytes, NODES_BYTES));
  }
}
