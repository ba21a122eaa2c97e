// Every pixel: the least depth over 3x3, enlarged; up to it a sample is seen without further tests.
layout(std430, binding = 0) readonly buffer Nearest { vec4 nearest[]; };
layout(std430, binding = 1) writeonly buffer Front { float front[]; };
uniform ivec2 size;

void main() {
    uint p = item();
    if (p >= count) return;
    ivec2 at = ivec2(int(p) % size.x, int(p) / size.x);
    float least = nearest[p].x;
    for (int y = max(at.y - 1, 0); y < min(at.y + 2, size.y); y++)
        for (int x = max(at.x - 1, 0); x < min(at.x + 2, size.x); x++) least = min(least, nearest[y * size.x + x].x);
    front[p] = least * BEHIND;
}
