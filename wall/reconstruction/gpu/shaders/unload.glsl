// Copy the words of a buffer to a texture, row by row.
layout(std430, binding = 0) readonly buffer Words { uint words[]; };
layout(r32ui, binding = 0) writeonly uniform uimage2D image;
uniform uint first;

void main() {
    uint n = item();
    if (n >= count) return;
    int width = imageSize(image).x;
    imageStore(image, ivec2(int(n) % width, int(n) / width), uvec4(words[first + n]));
}
