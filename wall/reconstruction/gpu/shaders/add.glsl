// Sums that many invocations add to, in any order: by float atomics, or by exchanging bits until nobody came between.
#ifdef FLOAT_ATOMICS
layout(std430, binding = SUMS) buffer Sums { float sums[]; };
void add(uint n, float value) { atomicAdd(sums[n], value); }
#else
layout(std430, binding = SUMS) buffer Sums { uint sums[]; };
void add(uint n, float value) {
    for (uint seen = sums[n], before = ~seen; before != seen;) {
        before = seen;
        seen = atomicCompSwap(sums[n], before, floatBitsToUint(uintBitsToFloat(before) + value));
    }
}
#endif

void add(ivec2 pixel, int width, vec4 value) {
    for (int c = 0; c < 4; c++) add(CHANNELS * uint(pixel.y * width + pixel.x) + uint(c), value[c]);
}
