// The tent of a sample, or a steeper one: each of the four pixels gets its share.
flat in vec4 value;
flat in vec2 corner;
flat in vec2 part;
out vec4 sum;

void main() {
    vec2 share = mix(1.0 - part, part, greaterThan(gl_FragCoord.xy, corner + 1.0));
    sum = share.x * share.y * value;
}
