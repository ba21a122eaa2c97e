// Every pixel: its nearest sample, for channels that compositing needs. Depths are cleared for the next pass over samples.
layout(std430, binding = 0) readonly buffer ScreenPosition { float screen[]; };
layout(std430, binding = 1) readonly buffer ObjectId { uint object_id[]; };
layout(std430, binding = 2) buffer Pixels { uint pixels[]; };  // planes: bits of the least depth, slot of its sample
layout(std430, binding = 3) writeonly buffer Nearest { vec4 nearest[]; };  // depth (inf: none), x, y, object id
layout(std430, binding = 4) writeonly buffer Surfaces { vec2 surfaces[]; };  // depth, object id

void main() {
    uint p = item();
    if (p >= count) return;
    uint k = pixels[count + p];
    vec4 found = vec4(uintBitsToFloat(INFINITY_BITS), 0.0, 0.0, -1.0);
    if (k != NOWHERE) found = vec4(screen[3 * k + DEPTH], screen[3 * k + X], screen[3 * k + Y], float(object_id[k]));
    nearest[p] = found;
    surfaces[p] = found.xw;
    pixels[p] = INFINITY_BITS;
    pixels[count + p] = NOWHERE;
}
