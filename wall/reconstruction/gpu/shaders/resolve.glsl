// The picture: weighted means, the filled coarser level where weight is missing, and where pixels stood still their own
// mean takes over.
layout(binding = 1) uniform sampler2D gathered;
layout(binding = 2) uniform sampler2D still;
layout(std430, binding = 0) writeonly buffer Base { float base[]; };
layout(std430, binding = 1) writeonly buffer Shown { float shown[]; };

void main() {
    uint p = item();
    if (p >= count) return;
    int width = textureSize(still, 0).x;
    ivec2 at = ivec2(int(p) % width, int(p) / width);
    vec4 pixel = texelFetch(gathered, at + 1, 0);
    vec3 mean = pixel.rgb / max(pixel.w, TRUSTED);
    if (pixel.w < TRUSTED) mean += (1.0 - pixel.w / TRUSTED) * between(at);
    vec4 own = texelFetch(still, at, 0);
    float part = 1.0 / ((1.0 + own.w) * (1.0 + own.w));
    vec3 mixed = part * mean + (1.0 - part) / max(own.w, 1e-6) * own.rgb;
    for (int c = 0; c < 3; c++) {
        base[3 * p + c] = mean[c];
        shown[3 * p + c] = mixed[c];
    }
}
