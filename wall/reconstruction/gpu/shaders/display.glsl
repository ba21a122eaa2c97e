// Encode four pixels as 8-bit sRGB in three words, by the curve of the CPU; not a number shows as 0.
layout(std430, binding = 0) readonly buffer Shown { float shown[]; };
layout(std430, binding = 1) readonly buffer Curve { uint curve[]; };
layout(std430, binding = 2) writeonly buffer Codes { uint codes[]; };
uniform uint values;  // three a pixel
uniform float gain;

uint code(uint n) {
    float value = n < values ? gain * shown[n] : 0.0;
    value = value > 0.0 ? min(value, 1.0) : 0.0;
    return curve[uint(sqrt(value) * CURVE_STEPS + 0.5)];
}

void main() {
    uint k = item();
    if (k >= count) return;
    for (uint word = 3u * k; word < 3u * k + 3u; word++)
        codes[word] = code(4u * word) | code(4u * word + 1u) << 8 | code(4u * word + 2u) << 16 | code(4u * word + 3u) << 24;
}
