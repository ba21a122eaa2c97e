// Count the samples of the image by class of age: the top bits of a float32 age are steps of 1/128 of it at most.
// Neighbours in the store are mostly of one class, so a group counts its youngest by itself.
layout(std430, binding = 0) readonly buffer ScreenPosition { float screen[]; };  // x, y, depth
layout(std430, binding = 1) readonly buffer State { float state[]; };  // time, confidence
layout(std430, binding = 2) buffer Ages { uint ages[]; };  // AGES counts, then the last age that stays
uniform float now;
shared uint youngest, counted;

void main() {
    uint k = item();
    if (gl_LocalInvocationIndex == 0u) {
        youngest = NOWHERE;
        counted = 0u;
    }
    barrier();
    bool lives = k < count && screen[3 * min(k, count - 1u) + DEPTH] > 0.0;
    uint age = lives ? min(floatBitsToUint(max(now - state[2 * k + TIME], 0.0)) >> AGE_SHIFT, AGES - 1u) : NOWHERE;
    if (lives) atomicMin(youngest, age);
    barrier();
    if (lives && age == youngest) atomicAdd(counted, 1u);
    else if (lives) atomicAdd(ages[age], 1u);
    barrier();
    if (gl_LocalInvocationIndex == 0u && counted > 0u) atomicAdd(ages[youngest], counted);
}
