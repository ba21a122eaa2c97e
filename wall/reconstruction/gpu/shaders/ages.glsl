// How many living samples there are of each age: the top bits of a float32 age are steps of 1/128 of it at most.
layout(std430, binding = 0) readonly buffer Screen { float screen[]; };
layout(std430, binding = 1) readonly buffer State { float state[]; };
layout(std430, binding = 2) buffer Ages { uint ages[]; };  // AGES counts, then the last age that stays
uniform float now;

void main() {
    uint k = item();
    if (k >= count || !(screen[3 * k + 2] > 0.0)) return;
    atomicAdd(ages[floatBitsToUint(max(now - state[2 * k], 0.0)) >> AGE_SHIFT], 1u);
}
