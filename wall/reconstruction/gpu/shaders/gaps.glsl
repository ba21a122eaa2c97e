// Every pixel in which no sample is stored: its accumulation is cleared where an object that moved or is lit anew shows so
// near that it may cover the pixel.
layout(std430, binding = 0) readonly buffer Nearest { vec4 nearest[]; };  // depth (inf: none), x, y, object id
layout(std430, binding = 1) readonly buffer Objects { float objects[]; };
layout(rgba32f, binding = 0) writeonly uniform image2D accumulation;  // mean radiance, count

void main() {
    uint p = item();
    if (p >= count || nearest[p].w >= 0.0) return;
    ivec2 size = imageSize(accumulation), at = ivec2(int(p) % size.x, int(p) / size.x);
    bool near = false;
    for (int y = max(at.y - AROUND, 0); y <= min(at.y + AROUND, size.y - 1); y++)
        for (int x = max(at.x - AROUND, 0); x <= min(at.x + AROUND, size.x - 1); x++) {
            float other = nearest[y * size.x + x].w;
            near = near || other >= 0.0 && objects[OBJECT_WORDS * int(other) + CHANGED] != 0.0;
        }
    if (near) imageStore(accumulation, at, vec4(0.0));
}
