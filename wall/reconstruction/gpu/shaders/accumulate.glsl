// Every new sample: add how it differs from the accumulated mean of its own pixel, and note whose it is.
layout(std430, binding = 1) readonly buffer ScreenPosition { float screen[]; };
layout(std430, binding = 2) readonly buffer Radiance { float radiance[]; };
layout(std430, binding = 3) readonly buffer ObjectId { uint object_id[]; };
layout(std430, binding = 4) buffer AccumulatedObjects { uint accumulated_objects[]; };  // planes: of means, of new samples
layout(binding = 0) uniform sampler2D accumulation;  // mean radiance, count
uniform ivec2 size;
uniform uint first;  // slot of the first one

void main() {
    uint k = first + item();
    if (item() >= count || !(screen[3 * k + DEPTH] > 0.0)) return;
    ivec2 pixel = clamp(ivec2(screen[3 * k + X], screen[3 * k + Y]), ivec2(0), size - 1);
    vec3 mean = texelFetch(accumulation, pixel, 0).rgb;
    add(pixel, size.x, vec4(vec3(radiance[3 * k], radiance[3 * k + 1], radiance[3 * k + 2]) - mean, 1.0));
    atomicOr(accumulated_objects[(size.y + pixel.y) * size.x + pixel.x], 1u << object_id[k] % OBJECT_BITS);
}
