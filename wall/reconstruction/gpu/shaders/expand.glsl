// Expand a level: divide it by its weight, and where that is below 1 mix in the coarser level.
layout(rgba32f, binding = 0) uniform image2D coarse;
uniform int top;

void main() {
    uint p = item();
    if (p >= count) return;
    int width = imageSize(coarse).x;
    ivec2 at = ivec2(int(p) % width, int(p) / width);
    vec4 pixel = imageLoad(coarse, at);
    vec3 shown = pixel.rgb / max(pixel.w, 1.0);
    if (pixel.w < 1.0) {
        if (top == 0) shown += (1.0 - pixel.w) * interpolate(at);
        else if (pixel.w > 0.0) shown /= pixel.w;
    }
    imageStore(coarse, at, vec4(shown, pixel.w));
}
