// Every sample: lose confidence where it was contradicted, clear what its pixel accumulated if its object moved or is lit
// anew, move with its object, find the least depth of its pixel.
layout(std430, binding = 0) readonly buffer Position { float position[]; };
layout(std430, binding = 1) readonly buffer ObjectId { uint object_id[]; };
layout(std430, binding = 2) buffer State { float state[]; };  // time, confidence
layout(std430, binding = 3) buffer ScreenPosition { float screen[]; };  // x, y, depth
layout(std430, binding = 4) readonly buffer Objects { float objects[]; };  // each: panel_from_object, MOVED, CHANGED
layout(std430, binding = 5) readonly buffer Rejection { uint rejection[]; };  // planes: share, ordinal, time, object
layout(std430, binding = 6) buffer Pixels { uint pixels[]; };  // planes: bits of the least depth, slot of its sample
layout(rgba32f, binding = 0) writeonly uniform image2D accumulation;  // mean radiance, count
uniform ivec2 size;
uniform int contradicted;

float confidence_after(uint k, vec3 at) {
    float confidence = state[2 * k + CONFIDENCE];
    uint area = uint(size.x * size.y), p = uint(int(at.y) * size.x + int(at.x));
    float share = uintBitsToFloat(rejection[p]);
    bool older = state[2 * k + TIME] < uintBitsToFloat(rejection[2 * area + p]);
    if (share > 0.0 && rejection[3 * area + p] == object_id[k] && older) confidence *= 1.0 - share;
    return confidence < LEAST_CONFIDENCE ? 0.0 : confidence;
}

vec3 moved_to(uint k, uint row) {
    vec4 point = vec4(position[3 * k + X], position[3 * k + Y], position[3 * k + Z], 1.0);
    float w = dot(vec4(objects[row], objects[row + 1], objects[row + 2], objects[row + 3]), point);
    float x = dot(vec4(objects[row + 4], objects[row + 5], objects[row + 6], objects[row + 7]), point) / w;
    float y = dot(vec4(objects[row + 8], objects[row + 9], objects[row + 10], objects[row + 11]), point) / w;
    bool inside = w > NEAREST && x >= 0.0 && y >= 0.0 && x < float(size.x) && y < float(size.y);
    return vec3(x, y, inside ? (object_id[k] == 0u ? FAR : w) : OUTSIDE);
}

void main() {
    uint k = item();
    if (k >= count) return;
    vec3 at = vec3(screen[3 * k + X], screen[3 * k + Y], screen[3 * k + DEPTH]);
    float confidence = state[2 * k + CONFIDENCE];
    if (contradicted != 0 && at.z > 0.0) {
        confidence = confidence_after(k, at);
        state[2 * k + CONFIDENCE] = confidence;
    }
    uint row = OBJECT_WORDS * object_id[k];
    if (objects[row + CHANGED] != 0.0 && at.z > 0.0) imageStore(accumulation, ivec2(at.xy), vec4(0.0));
    if (objects[row + MOVED] != 0.0) at = moved_to(k, row);
    if (confidence == 0.0) at.z = OUTSIDE;
    screen[3 * k + X] = at.x;
    screen[3 * k + Y] = at.y;
    screen[3 * k + DEPTH] = at.z;
    if (at.z > 0.0) atomicMin(pixels[uint(int(at.y) * size.x + int(at.x))], floatBitsToUint(at.z));
}
