// Every channel of every sample: add its tent, or a steeper one, to the sums of the four nearest pixels; the image has a
// border. Four invocations a sample, so that those side by side add to the same 16 bytes.
layout(std430, binding = 1) readonly buffer ScreenPosition { float screen[]; };
layout(std430, binding = 2) readonly buffer Radiance { float radiance[]; };
layout(std430, binding = 3) readonly buffer Weight { float weight[]; };
layout(std430, binding = 4) readonly buffer Bounds { float bounds[]; };  // conservative depth, decay, density
uniform ivec2 size;

void main() {
    uint k = item() / CHANNELS, c = item() % CHANNELS;
    if (k >= count || !(weight[k] > 0.0)) return;
    vec2 at = vec2(screen[3 * k + X], screen[3 * k + Y]);
    float sharp = clamp(bounds[3 * (int(at.y) * size.x + int(at.x)) + 2], 1.0, SHARPEST);
    ivec2 corner = ivec2(floor(at + 0.5));  // of the border's frame: the upper left one of the four
    vec2 part = clamp((at - vec2(corner)) * sharp + 0.5, 0.0, 1.0);  // of the pixel to the right, below
    float value = c < 3 ? weight[k] * radiance[3 * k + c] : weight[k];
    for (int y = 0; y < 2; y++)
        for (int x = 0; x < 2; x++) {
            float share = (x == 0 ? 1.0 - part.x : part.x) * (y == 0 ? 1.0 - part.y : part.y);
            uint pixel = uint((corner.y + y) * (size.x + 2) + corner.x + x);
            if (share > 0.0) add(CHANNELS * pixel + c, share * value);
        }
}
