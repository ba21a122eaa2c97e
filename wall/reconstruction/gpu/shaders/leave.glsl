// Samples up to a time leave the picture.
layout(std430, binding = 0) readonly buffer State { float state[]; };
layout(std430, binding = 1) buffer Screen { float screen[]; };
uniform float latest;

void main() {
    uint k = item();
    if (k < count && state[2 * k] <= latest) screen[3 * k + 2] = OUTSIDE;
}
