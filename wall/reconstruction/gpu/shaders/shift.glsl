// A clock starts anew: every time is so much less.
layout(std430, binding = 0) buffer Times { float times[]; };
uniform uint offset;
uniform uint stride;
uniform float later;

void main() {
    uint k = item();
    if (k < count) times[offset + stride * k] -= later;
}
