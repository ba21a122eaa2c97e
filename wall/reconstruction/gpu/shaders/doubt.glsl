// New samples that contradict the picture: doubt the 3x3 pixels around each, the less the farther they are; the greatest
// doubt of a pixel stays, the first of equals. Three stages, since no atomic carries a time and an object along.
layout(std430, binding = 0) readonly buffer Changes { float change[]; };
layout(std430, binding = 1) readonly buffer Screen { float screen[]; };  // x, y, depth
layout(std430, binding = 2) readonly buffer State { float state[]; };  // time, confidence
layout(std430, binding = 3) readonly buffer Name { uint name[]; };
layout(std430, binding = 4) buffer Doubt { uint doubt[]; };  // planes: amount, ordinal, time, object
uniform uint first;  // slot of the first new sample
uniform uint ordinal;  // new samples before it since the last refresh
uniform int stage;
uniform ivec2 size;

void touch(uint p, float amount, uint n) {
    uint area = uint(size.x * size.y), bits = floatBitsToUint(amount);
    if (stage == 0) {
        if (atomicMax(doubt[p], bits) < bits) doubt[area + p] = 0xffffffffu;  // whoever was first at less counts no more
    } else if (doubt[p] == bits) {
        if (stage == 1) atomicMin(doubt[area + p], ordinal + n);
        else if (doubt[area + p] == ordinal + n) {
            doubt[2 * area + p] = floatBitsToUint(state[2 * (first + n)]);
            doubt[3 * area + p] = name[first + n];
        }
    }
}

void main() {
    uint n = item();
    if (n >= count) return;
    uint k = first + n;
    if (!(change[n] > 0.0) || !(screen[3 * k + 2] > 0.0)) return;
    ivec2 at = ivec2(screen[3 * k], screen[3 * k + 1]);
    for (int y = max(at.y - 1, 0); y < min(at.y + 2, size.y); y++) {
        for (int x = max(at.x - 1, 0); x < min(at.x + 2, size.x); x++) {
            ivec2 d = ivec2(x, y) - at;
            touch(uint(y * size.x + x), change[n] / (1.0 + 0.5 * float(d.x * d.x + d.y * d.y)), n);
        }
    }
}
