// Merge the sums of new samples into the accumulated means of their pixels; running sums would drift.
layout(rgba32f, binding = 0) uniform image2D accumulation;  // mean radiance, count
layout(binding = 0) uniform sampler2D batch;  // sums of differences from that mean, and how many

void main() {
    uint p = item();
    if (p >= count) return;
    ivec2 at = ivec2(int(p) % imageSize(accumulation).x, int(p) / imageSize(accumulation).x);
    vec4 sums = texelFetch(batch, at, 0), own = imageLoad(accumulation, at);
    if (sums.w > 0.0) imageStore(accumulation, at, vec4(own.rgb + sums.rgb / (own.w + sums.w), own.w + sums.w));
}
