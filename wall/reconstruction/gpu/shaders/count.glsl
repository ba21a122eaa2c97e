// Count the samples of each group that are in the image; `rank` gets the rank of each within its group.
layout(std430, binding = 0) readonly buffer ScreenPosition { float screen[]; };
layout(std430, binding = 1) writeonly buffer Rank { uint rank[]; };
layout(std430, binding = 2) writeonly buffer Groups { uint groups[]; };
shared uint sums[GROUP];

void main() {
    uint k = item(), me = gl_LocalInvocationIndex;
    bool lives = k < count && screen[3 * min(k, count - 1u) + DEPTH] > 0.0;
    sums[me] = lives ? 1u : 0u;
    barrier();
    for (uint step = 1u; step < GROUP; step *= 2u) {
        uint before = me >= step ? sums[me - step] : 0u;
        barrier();
        sums[me] += before;
        barrier();
    }
    if (k < count) rank[k] = lives ? sums[me] - 1u : NOWHERE;
    if (me == GROUP - 1u && group() * GROUP < count) groups[group()] = sums[me];
}
