// Every sample: lose confidence where it was doubted, move with its object, find the least depth of its pixel.
layout(std430, binding = 0) readonly buffer Place { float place[]; };
layout(std430, binding = 1) readonly buffer Name { uint name[]; };
layout(std430, binding = 2) buffer State { float state[]; };
layout(std430, binding = 3) buffer Screen { float screen[]; };
layout(std430, binding = 4) readonly buffer Objects { float objects[]; };  // each: panel_from_object, whether it changed
layout(std430, binding = 5) readonly buffer Tiles { vec2 tiles[]; };  // share that is stale, decay
layout(std430, binding = 6) readonly buffer Doubt { uint doubt[]; };
layout(std430, binding = 7) buffer Pixels { uint pixels[]; };  // planes: bits of the least depth, slot of its sample
uniform ivec2 size;
uniform int tile_columns;
uniform int doubted;
uniform float since;

float confidence_after(uint k, vec3 at) {
    float time = state[2 * k], confidence = state[2 * k + 1];
    uint area = uint(size.x * size.y), p = uint(int(at.y) * size.x + int(at.x));
    float amount = uintBitsToFloat(doubt[p]);
    if (amount > 0.0 && doubt[3 * area + p] == name[k] && time < uintBitsToFloat(doubt[2 * area + p]))
        confidence *= 1.0 - amount;
    if (time < since) confidence *= 1.0 - tiles[int(at.y) / TILE * tile_columns + int(at.x) / TILE].x;
    return confidence < FORGOTTEN ? 0.0 : confidence;
}

vec3 moved_to(uint k, uint row) {
    vec4 point = vec4(place[3 * k], place[3 * k + 1], place[3 * k + 2], 1.0);
    float w = dot(vec4(objects[row], objects[row + 1], objects[row + 2], objects[row + 3]), point);
    float x = dot(vec4(objects[row + 4], objects[row + 5], objects[row + 6], objects[row + 7]), point) / w;
    float y = dot(vec4(objects[row + 8], objects[row + 9], objects[row + 10], objects[row + 11]), point) / w;
    bool inside = w > NEAREST && x >= 0.0 && y >= 0.0 && x < float(size.x) && y < float(size.y);
    return vec3(x, y, inside ? (name[k] == 0u ? FAR : w) : OUTSIDE);
}

void main() {
    uint k = item();
    if (k >= count) return;
    vec3 at = vec3(screen[3 * k], screen[3 * k + 1], screen[3 * k + 2]);
    float confidence = state[2 * k + 1];
    if (doubted != 0 && at.z > 0.0) {
        confidence = confidence_after(k, at);
        state[2 * k + 1] = confidence;
    }
    uint row = OBJECT_WORDS * name[k];
    if (objects[row + 12] != 0.0) at = moved_to(k, row);
    if (confidence == 0.0) at.z = OUTSIDE;
    screen[3 * k] = at.x;
    screen[3 * k + 1] = at.y;
    screen[3 * k + 2] = at.z;
    if (at.z > 0.0) atomicMin(pixels[uint(int(at.y) * size.x + int(at.x))], floatBitsToUint(at.z));
}
