// Of the samples at the least depth of their pixel, the first in the store is the nearest.
layout(std430, binding = 0) readonly buffer ScreenPosition { float screen[]; };
layout(std430, binding = 1) buffer Pixels { uint pixels[]; };
uniform ivec2 size;

void main() {
    uint k = item();
    if (k >= count || !(screen[3 * k + DEPTH] > 0.0)) return;
    uint p = uint(int(screen[3 * k + Y]) * size.x + int(screen[3 * k + X]));
    if (pixels[p] == floatBitsToUint(screen[3 * k + DEPTH])) atomicMin(pixels[uint(size.x * size.y) + p], k);
}
