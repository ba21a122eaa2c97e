// Sum how new samples differ from the accumulated means of their own pixels.
layout(std430, binding = 0) readonly buffer ScreenPosition { float screen[]; };  // x, y, depth
layout(std430, binding = 1) readonly buffer Radiance { float radiance[]; };
layout(binding = 0) uniform sampler2D accumulation;  // mean radiance, count
uniform ivec2 size;
flat out vec4 value;

void main() {
    uint k = uint(gl_VertexID);
    bool shown = screen[3 * k + 2] > 0.0;
    ivec2 pixel = clamp(ivec2(screen[3 * k], screen[3 * k + 1]), ivec2(0), size - 1);
    vec3 mean = texelFetch(accumulation, pixel, 0).rgb;
    value = vec4(vec3(radiance[3 * k], radiance[3 * k + 1], radiance[3 * k + 2]) - mean, 1.0);
    gl_PointSize = 1.0;
    gl_Position = shown ? vec4((vec2(pixel) + 0.5) / vec2(size) * 2.0 - 1.0, 0.0, 1.0) : vec4(2.0, 2.0, 2.0, 1.0);
}
