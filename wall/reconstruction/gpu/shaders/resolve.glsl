// Resolve the image: weighted means, the filled coarser level where weight is missing, and the mean that pixels
// accumulated at rest mixed in, or alone.
layout(binding = 1) uniform sampler2D splat_sums;
layout(binding = 2) uniform sampler2D accumulation;  // mean radiance, count
layout(std430, binding = 0) writeonly buffer Resolved { float resolved[]; };
layout(std430, binding = 1) writeonly buffer Shown { float shown[]; };

void main() {
    uint p = item();
    if (p >= count) return;
    int width = textureSize(accumulation, 0).x;
    ivec2 at = ivec2(int(p) % width, int(p) / width);
    vec4 pixel = texelFetch(splat_sums, at + 1, 0);
    vec3 mean = pixel.rgb / max(pixel.w, TRUSTED);
    if (pixel.w < TRUSTED) mean += (1.0 - pixel.w / TRUSTED) * interpolate(at);
    vec4 own = texelFetch(accumulation, at, 0);
    float part = own.w < MEAN_ALONE ? 1.0 / ((1.0 + own.w) * (1.0 + own.w)) : 0.0;
    vec3 mixed = part * mean + (1.0 - part) * own.rgb;
    for (int c = 0; c < 3; c++) {
        resolved[3 * p + c] = mean[c];
        shown[3 * p + c] = mixed[c];
    }
}
