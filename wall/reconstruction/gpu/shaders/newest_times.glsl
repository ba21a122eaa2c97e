// The time of each pixel's newest sample, in three stages: clear, find the greatest of the samples' times as integers of
// the same order, make floats of them again; -inf where there is no sample.
layout(std430, binding = 0) readonly buffer ScreenPosition { float screen[]; };
layout(std430, binding = 1) readonly buffer State { float state[]; };  // time, confidence
layout(std430, binding = 2) buffer Times { uint times[]; };
uniform int stage;
uniform ivec2 size;

const uint SIGN = 0x80000000u, NONE = 0u;  // the integer of no number

void main() {
    uint k = item();
    if (k >= count) return;
    if (stage == 0) {
        times[k] = NONE;
    } else if (stage == 1) {
        if (!(screen[3 * k + DEPTH] > 0.0) || !(state[2 * k + CONFIDENCE] > 0.0)) return;
        uint bits = floatBitsToUint(state[2 * k + TIME]);
        atomicMax(times[int(screen[3 * k + Y]) * size.x + int(screen[3 * k + X])], bits < SIGN ? bits | SIGN : ~bits);
    } else {
        uint newest = times[k];
        times[k] = newest == NONE ? INFINITY_BITS | SIGN : newest < SIGN ? ~newest : newest ^ SIGN;
    }
}
