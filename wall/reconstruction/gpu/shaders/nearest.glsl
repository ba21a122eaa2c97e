// Every pixel: its nearest sample in one vector. Its accumulation is cleared where the object that it shows moved or is lit
// anew, or where it holds samples of such an object; shortened where samples contradicted it. Depths and rejections are
// cleared for the next refresh.
layout(std430, binding = 0) readonly buffer ScreenPosition { float screen[]; };
layout(std430, binding = 1) readonly buffer ObjectId { uint object_id[]; };
layout(std430, binding = 2) readonly buffer Objects { float objects[]; };
layout(std430, binding = 3) buffer Pixels { uint pixels[]; };  // planes: bits of the least depth, slot of its sample
layout(std430, binding = 4) buffer Rejection { uint rejection[]; };
layout(std430, binding = 5) writeonly buffer Nearest { vec4 nearest[]; };  // depth (inf: none), x, y, object id
layout(std430, binding = 6) readonly buffer AccumulatedObjects { uint accumulated_objects[]; };
layout(rgba32f, binding = 0) uniform image2D accumulation;  // mean radiance, count
uniform uint changed;  // bits of objects
uniform int told_apart;  // no two objects share a bit
uniform int contradicted;
uniform int clear;  // 1: only that

void main() {
    uint p = item();
    if (p >= count) return;
    if (clear == 0) {
        uint k = pixels[count + p];
        bool seen = k != NOWHERE;
        nearest[p] = seen ? vec4(screen[3 * k + DEPTH], screen[3 * k + X], screen[3 * k + Y], float(object_id[k]))
                          : vec4(uintBitsToFloat(INFINITY_BITS), 0.0, 0.0, -1.0);
        ivec2 at = ivec2(int(p) % imageSize(accumulation).x, int(p) / imageSize(accumulation).x);
        bool gone = (accumulated_objects[p] & changed) != 0u && (!seen || told_apart != 0);
        if (gone || seen && objects[OBJECT_WORDS * object_id[k] + CHANGED] != 0.0) {
            imageStore(accumulation, at, vec4(0.0));
        } else if (contradicted != 0 && (accumulated_objects[p] & 1u << rejection[3 * count + p] % OBJECT_BITS) != 0u) {
            float keep = 1.0 - uintBitsToFloat(rejection[p]);  // one contradiction outweighs many samples that agreed
            if (keep < 1.0) imageStore(accumulation, at, imageLoad(accumulation, at) * vec4(vec3(1.0), keep * keep * keep));
        }
    }
    pixels[p] = INFINITY_BITS;
    pixels[count + p] = NOWHERE;
    if (contradicted != 0) {
        rejection[p] = 0u;
        rejection[count + p] = NOWHERE;
    }
}
