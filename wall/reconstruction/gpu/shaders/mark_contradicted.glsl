// Mark the pixels within REACH of samples that contradict the image for history rejection, less with distance. The greatest
// share of a pixel stays, the first of equals. Three stages, since no atomic carries a time and an object along.
layout(std430, binding = 0) readonly buffer Changes { float change[]; };
layout(std430, binding = 1) readonly buffer ScreenPosition { float screen[]; };  // x, y, depth
layout(std430, binding = 2) readonly buffer State { float state[]; };  // time, confidence
layout(std430, binding = 3) readonly buffer ObjectId { uint object_id[]; };
layout(std430, binding = 4) buffer Rejection { uint rejection[]; };  // planes: share, ordinal, time, object
uniform uint first;  // slot of the first new sample
uniform uint ordinal;  // new samples before it since the last refresh
uniform int stage;
uniform ivec2 size;
const float SHARE_AT[] = SHARES;  // row by row, those within REACH: no division, whose last bit is not sure

void mark(uint p, float share, uint n) {
    uint area = uint(size.x * size.y), bits = floatBitsToUint(share);
    if (stage == 0) {
        if (atomicMax(rejection[p], bits) < bits) rejection[area + p] = NOWHERE;  // the first at a smaller share
    } else if (rejection[p] == bits) {
        if (stage == 1) atomicMin(rejection[area + p], ordinal + n);
        else if (rejection[area + p] == ordinal + n) {
            rejection[2 * area + p] = floatBitsToUint(state[2 * (first + n) + TIME]);
            rejection[3 * area + p] = object_id[first + n];
        }
    }
}

void main() {
    uint n = item();
    if (n >= count) return;
    uint k = first + n;
    if (!(change[n] > 0.0) || !(screen[3 * k + DEPTH] > 0.0)) return;
    ivec2 at = ivec2(screen[3 * k + X], screen[3 * k + Y]);
    for (int y = max(at.y - REACH, 0); y < min(at.y + REACH + 1, size.y); y++) {
        for (int x = max(at.x - REACH, 0); x < min(at.x + REACH + 1, size.x); x++) {
            ivec2 d = ivec2(x, y) - at + REACH;
            mark(uint(y * size.x + x), change[n] * SHARE_AT[(2 * REACH + 1) * d.y + d.x], n);
        }
    }
}
