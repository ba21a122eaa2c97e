// Encode four pixels as 8-bit sRGB in three words, by the curve of the CPU; not a number shows as 0.
layout(std430, binding = 0) readonly buffer Shown { float shown[]; };
layout(std430, binding = 1) readonly buffer Curve { uint curve[]; };
layout(std430, binding = 2) writeonly buffer Codes { uint codes[]; };
uniform uint values;  // three a pixel
uniform float gain;
uniform uint mapping;  // core/kernels/tone_mapping.py, whose curves and constants these are

vec3 neutral(vec3 light) {
    float least = min(light.r, min(light.g, light.b));
    light -= least < 0.08 ? least - 6.25 * least * least : 0.04;
    float peak = max(light.r, max(light.g, light.b));
    if (peak < 0.76) return light;
    float brought = 1.0 - 0.24 * 0.24 / (peak + 0.24 - 0.76);
    return mix(light * (brought / peak), vec3(brought), 1.0 - 1.0 / (0.15 * (peak - brought) + 1.0));
}

float light_of(uint n) {
    float value = n < values ? gain * shown[n] : 0.0;
    return value > 0.0 ? min(value, mapping == 0u ? 1.0 : 1e6) : 0.0;
}

uint code(uint n) {
    float value = light_of(n);
    if (mapping == 1u) value /= 1.0 + value;
    if (mapping == 2u) value = min(value * (2.51 * value + 0.03) / (value * (2.43 * value + 0.59) + 0.14), 1.0);
    if (mapping == 3u) {
        uint first = n - n % 3u;
        value = neutral(vec3(light_of(first), light_of(first + 1u), light_of(first + 2u)))[n - first];
    }
    return curve[uint(sqrt(value) * CURVE_STEPS + 0.5)];
}

void main() {
    uint k = item();
    if (k >= count) return;
    for (uint word = 3u * k; word < 3u * k + 3u; word++)
        codes[word] = code(4u * word) | code(4u * word + 1u) << 8 | code(4u * word + 2u) << 16 | code(4u * word + 3u) << 24;
}
