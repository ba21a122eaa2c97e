// Turn the counts of groups into running totals: where each group begins. One group; the total comes last.
layout(std430, binding = 0) buffer Groups { uint groups[]; };
shared uint sums[GROUP];

void main() {
    uint me = gl_LocalInvocationIndex, run = (count + GROUP - 1u) / GROUP;
    uint begin = min(me * run, count), end = min(begin + run, count), own = 0u;
    for (uint n = begin; n < end; n++) own += groups[n];
    sums[me] = own;
    barrier();
    if (me == 0u) {
        uint total = 0u;
        for (uint n = 0u; n < GROUP; n++) {
            uint here = sums[n];
            sums[n] = total;
            total += here;
        }
        groups[count] = total;
    }
    barrier();
    uint total = sums[me];
    for (uint n = begin; n < end; n++) {
        uint here = groups[n];
        groups[n] = total;
        total += here;
    }
}
