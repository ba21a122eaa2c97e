// Every pixel in which no sample is left: its accumulation is cleared where a pixel near it shows an object that moved or
// is lit anew, which may have come there.
layout(std430, binding = 0) readonly buffer Nearest { vec4 nearest[]; };  // depth (inf: none), x, y, object id
layout(std430, binding = 1) readonly buffer Objects { float objects[]; };
layout(rgba32f, binding = 0) writeonly uniform image2D accumulation;  // mean radiance, count
uniform ivec2 size;

void main() {
    uint p = item();
    if (p >= count || nearest[p].w >= 0.0) return;
    ivec2 at = ivec2(int(p) % size.x, int(p) / size.x);
    bool changed = false;
    for (int y = max(at.y - AROUND, 0); y < min(at.y + AROUND + 1, size.y); y++)
        for (int x = max(at.x - AROUND, 0); x < min(at.x + AROUND + 1, size.x); x++) {
            float other = nearest[y * size.x + x].w;
            changed = changed || other >= 0.0 && objects[OBJECT_WORDS * int(other) + CHANGED] != 0.0;
        }
    if (changed) imageStore(accumulation, at, vec4(0.0));
}
