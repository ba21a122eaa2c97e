// Every pixel: nothing is accumulated.
layout(rgba32f, binding = 0) writeonly uniform image2D accumulation;  // mean radiance, count

void main() {
    uint p = item();
    if (p >= count) return;
    int width = imageSize(accumulation).x;
    imageStore(accumulation, ivec2(int(p) % width, int(p) / width), vec4(0.0));
}
