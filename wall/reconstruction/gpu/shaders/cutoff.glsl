// Find the last class of age that stays, so that at least `wanted` samples do. One group; counts are cleared.
layout(std430, binding = 0) buffer Ages { uint ages[]; };
uniform uint wanted;
shared uint sums[GROUP];
const uint RUN = AGES / GROUP;

void main() {
    uint me = gl_LocalInvocationIndex, own = 0u;
    for (uint n = 0u; n < RUN; n++) own += ages[me * RUN + n];
    sums[me] = own;
    barrier();
    if (me == 0u) {
        ages[AGES] = AGES;
        uint younger = 0u;
        for (uint run = 0u; run < GROUP; run++) {
            if (younger + sums[run] < wanted) {
                younger += sums[run];
                continue;
            }
            uint n = run * RUN;
            for (; younger + ages[n] < wanted; n++) younger += ages[n];
            ages[AGES] = n;
            break;
        }
    }
    barrier();
    memoryBarrierBuffer();
    for (uint n = 0u; n < RUN; n++) ages[me * RUN + n] = 0u;
}
