// Make one level of the pyramid: sums over 2x2, a pixel of weight `trusted` or more counting once.
layout(binding = 0) uniform sampler2D fine;
layout(rgba32f, binding = 0) writeonly uniform image2D coarse;
uniform int border;
uniform float trusted;

void main() {
    uint p = item();
    if (p >= count) return;
    int width = imageSize(coarse).x;
    ivec2 at = ivec2(int(p) % width, int(p) / width), end = textureSize(fine, 0) - 2 * border;
    vec4 sum = vec4(0.0);
    for (int y = 2 * at.y; y < min(2 * at.y + 2, end.y); y++) {
        for (int x = 2 * at.x; x < min(2 * at.x + 2, end.x); x++) {
            vec4 pixel = texelFetch(fine, ivec2(x, y) + border, 0);
            sum += pixel / max(pixel.w, trusted);
        }
    }
    imageStore(coarse, at, sum);
}
