// Merge the sums of new samples into the accumulated means of their pixels, and clear them; running sums would drift.
layout(std430, binding = 0) buffer Sums { vec4 sums[]; };  // of differences from that mean, and how many
layout(std430, binding = 1) buffer AccumulatedObjects { uint accumulated_objects[]; };  // planes: of means, of new samples
layout(rgba32f, binding = 0) uniform image2D accumulation;  // mean radiance, count

void main() {
    uint p = item();
    if (p >= count || !(sums[p].w > 0.0)) return;
    int width = imageSize(accumulation).x;
    ivec2 at = ivec2(int(p) % width, int(p) / width);
    vec4 own = imageLoad(accumulation, at), all = vec4(own.rgb, own.w + sums[p].w);
    all.rgb += sums[p].rgb / all.w;
    imageStore(accumulation, at, all);
    accumulated_objects[p] = (own.w > 0.0 ? accumulated_objects[p] : 0u) | accumulated_objects[count + p];
    accumulated_objects[count + p] = 0u;
    sums[p] = vec4(0.0);
}
