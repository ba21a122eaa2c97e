// Take samples up to a time out of the image.
layout(std430, binding = 0) readonly buffer State { float state[]; };
layout(std430, binding = 1) buffer ScreenPosition { float screen[]; };
uniform float latest;

void main() {
    uint k = item();
    if (k < count && state[2 * k + TIME] <= latest) screen[3 * k + DEPTH] = OUTSIDE;
}
