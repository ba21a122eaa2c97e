// Shared by every compute pass. Samples are structures of arrays, as in the store on the CPU, one item an invocation.
layout(local_size_x = GROUP) in;

uniform uint count;  // items of this pass

uint group() { return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x; }
uint item() { return group() * GROUP + gl_LocalInvocationIndex; }
