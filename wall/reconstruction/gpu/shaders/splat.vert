// Draw a sample as a point of 2x2 pixels about the corner between its four nearest pixel centres; the image has a border.
layout(std430, binding = 0) readonly buffer ScreenPosition { float screen[]; };
layout(std430, binding = 1) readonly buffer Radiance { float radiance[]; };
layout(std430, binding = 2) readonly buffer Weight { float weight[]; };
layout(std430, binding = 3) readonly buffer Bounds { float bounds[]; };
uniform ivec2 size;
flat out vec4 value;  // weighted radiance and weight
flat out vec2 corner;
flat out vec2 part;  // of the pixel to the right, below

void main() {
    uint k = uint(gl_VertexID);
    float w = weight[k];
    vec2 at = vec2(screen[3 * k], screen[3 * k + 1]);
    ivec2 pixel = clamp(ivec2(at), ivec2(0), size - 1);  // what is not drawn may lie anywhere
    float sharp = clamp(bounds[3 * (pixel.y * size.x + pixel.x) + 2], 1.0, SHARPEST);
    at += 0.5;
    corner = floor(at);
    part = clamp((at - corner - 0.5) * sharp + 0.5, 0.0, 1.0);
    value = w * vec4(radiance[3 * k], radiance[3 * k + 1], radiance[3 * k + 2], 1.0);
    gl_PointSize = 2.0;
    gl_Position = w > 0.0 ? vec4((corner + 1.0) / (vec2(size) + 2.0) * 2.0 - 1.0, 0.0, 1.0) : vec4(2.0, 2.0, 2.0, 1.0);
}
