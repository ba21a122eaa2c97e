// Of the samples at their pixel's least depth, the first in the store is its nearest.
layout(std430, binding = 0) readonly buffer Screen { float screen[]; };
layout(std430, binding = 1) buffer Pixels { uint pixels[]; };
uniform ivec2 size;

void main() {
    uint k = item();
    if (k >= count || !(screen[3 * k + 2] > 0.0)) return;
    uint p = uint(int(screen[3 * k + 1]) * size.x + int(screen[3 * k]));
    if (pixels[p] == floatBitsToUint(screen[3 * k + 2])) atomicMin(pixels[uint(size.x * size.y) + p], k);
}
