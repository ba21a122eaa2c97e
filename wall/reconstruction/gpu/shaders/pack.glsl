// Copy the words of one array of the samples that stay close together, in their order.
layout(std430, binding = 0) readonly buffer Rank { uint rank[]; };
layout(std430, binding = 1) readonly buffer Groups { uint groups[]; };
layout(std430, binding = 2) readonly buffer From { uint from[]; };
layout(std430, binding = 3) writeonly buffer To { uint to[]; };
uniform uint words;

void main() {
    uint k = item();
    if (k >= count || rank[k] == NOWHERE) return;
    uint target = groups[group()] + rank[k];
    for (uint c = 0u; c < words; c++) to[words * target + c] = from[words * k + c];
}
