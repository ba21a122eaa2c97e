// Subtract from every time: the clock starts anew.
layout(std430, binding = 0) buffer Times { float times[]; };
uniform uint offset;
uniform uint stride;
uniform float later;

void main() {
    uint k = item();
    if (k < count) times[offset + stride * k] -= later;
}
