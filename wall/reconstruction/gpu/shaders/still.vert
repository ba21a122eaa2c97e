// New samples into the means of their own pixels.
layout(std430, binding = 0) readonly buffer Screen { float screen[]; };
layout(std430, binding = 1) readonly buffer Colour { float colour[]; };
uniform ivec2 size;
flat out vec4 value;

void main() {
    uint k = uint(gl_VertexID);
    vec2 centre = floor(vec2(screen[3 * k], screen[3 * k + 1])) + 0.5;
    value = vec4(colour[3 * k], colour[3 * k + 1], colour[3 * k + 2], 1.0);
    gl_PointSize = 1.0;
    gl_Position = screen[3 * k + 2] > 0.0 ? vec4(centre / vec2(size) * 2.0 - 1.0, 0.0, 1.0) : vec4(2.0, 2.0, 2.0, 1.0);
}
