// Every pixel: move its sums to the image, and clear them for the next refresh.
layout(std430, binding = 0) buffer Sums { vec4 sums[]; };
layout(rgba32f, binding = 0) writeonly uniform image2D image;

void main() {
    uint p = item();
    if (p >= count) return;
    int width = imageSize(image).x;
    imageStore(image, ivec2(int(p) % width, int(p) / width), sums[p]);
    sums[p] = vec4(0.0);
}
