// Every pixel: the least depth over 3x3, enlarged; up to it a sample is seen without further tests. And RIM where deeper
// surfaces show within the 3x3. And how samples crowd in the picture before.
layout(binding = 0) uniform sampler2D gathered;
layout(std430, binding = 0) readonly buffer Nearest { vec4 nearest[]; };
layout(std430, binding = 1) writeonly buffer Front { float front[]; };
layout(std430, binding = 2) readonly buffer Objects { float objects[]; };
uniform ivec2 size;

void main() {
    uint p = item();
    if (p >= count) return;
    ivec2 at = ivec2(int(p) % size.x, int(p) / size.x);
    float nothing = uintBitsToFloat(0x7f800000u), least = nothing, most = 0.0;
    bool moves = false;
    for (int y = max(at.y - 1, 0); y < min(at.y + 2, size.y); y++)
        for (int x = max(at.x - 1, 0); x < min(at.x + 2, size.x); x++) {
            vec4 other = nearest[y * size.x + x];
            float depth = other.x;
            moves = moves || other.w >= 0.0 && objects[OBJECT_WORDS * int(other.w) + 12] != 0.0;
            least = min(least, depth);
            most = max(most, depth < nothing ? depth : 0.0);
        }
    front[3 * p] = least * BEHIND;
    float crowd = texelFetch(gathered, at + 1, 0).w / CROWD, pace = crowd > 0.0 ? clamp(crowd, SLOWEST, SHARPEST) : 1.0;
    front[3 * p + 1] = most > least * BEHIND ? RIM * (moves ? 1.0 : pace) : 0.0;
    front[3 * p + 2] = crowd;
}
