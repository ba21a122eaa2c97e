// Every pixel: the conservative depth, up to which samples are visible without further tests: the least over 3x3 pixels,
// enlarged. SILHOUETTE_PER_S where deeper surfaces show within the 3x3. And how dense samples are in the image before.
layout(binding = 0) uniform sampler2D splat_sums;
layout(std430, binding = 0) readonly buffer Nearest { vec4 nearest[]; };  // depth (inf: none), x, y, object id
layout(std430, binding = 1) writeonly buffer Bounds { float bounds[]; };  // conservative depth, decay, density
layout(std430, binding = 2) readonly buffer Objects { float objects[]; };
uniform ivec2 size;
uniform float behind_own;  // see kernels.visibility.Behind

void main() {
    uint p = item();
    if (p >= count) return;
    ivec2 at = ivec2(int(p) % size.x, int(p) / size.x);
    float nothing = uintBitsToFloat(INFINITY_BITS), least = nothing, most = 0.0;
    bool moves = false;
    for (int y = max(at.y - 1, 0); y < min(at.y + 2, size.y); y++)
        for (int x = max(at.x - 1, 0); x < min(at.x + 2, size.x); x++) {
            vec4 other = nearest[y * size.x + x];
            float depth = other.x;
            moves = moves || other.w >= 0.0 && objects[OBJECT_WORDS * int(other.w) + MOVED] != 0.0;
            least = min(least, depth);
            most = max(most, depth < nothing ? depth : 0.0);
        }
    float density = texelFetch(splat_sums, at + 1, 0).w / DENSE;
    float pace = density > 0.0 ? clamp(density, SLOWEST, SHARPEST) : 1.0;
    bounds[3 * p] = least * behind_own;
    bounds[3 * p + 1] = pace * SLOW_DECAY + (most > least * behind_own ? SILHOUETTE_PER_S * (moves ? 1.0 : pace) : 0.0);
    bounds[3 * p + 2] = density;
}
