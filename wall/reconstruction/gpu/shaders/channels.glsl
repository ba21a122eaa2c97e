// Every pixel of an image: depth, object id and alpha, as channels_of_nearest finds them on the CPU. An image of a
// transparent layer is cleared where nothing is.
layout(std430, binding = 0) readonly buffer Nearest { vec4 nearest[]; };  // depth (inf: none), x, y, object id
layout(std430, binding = 1) readonly buffer Covered { float covered[]; };  // share that objects cover, three times
layout(std430, binding = 2) buffer Shown { float shown[]; };
layout(std430, binding = 3) writeonly buffer Channels { uint channels[]; };  // planes: depth, object id, alpha
uniform ivec2 size;
uniform int transparent;
uniform vec3 corner;  // direction through the centre of the first pixel, depth 1 along the panel's axis
uniform vec3 across;  // from there to the next pixel of its row, and of its column
uniform vec3 down;

vec2 nearest_around(ivec2 at) {
    vec2 found = vec2(uintBitsToFloat(INFINITY_BITS), 0.0);
    for (int y = max(at.y - 1, 0); y < min(at.y + 2, size.y); y++) {
        for (int x = max(at.x - 1, 0); x < min(at.x + 2, size.x); x++) {
            vec4 other = nearest[y * size.x + x];
            if (other.w > 0.0 && other.x < found.x) found = other.xw;
        }
    }
    return found;
}

void main() {
    uint p = item();
    if (p >= count) return;
    ivec2 at = ivec2(int(p) % size.x, int(p) / size.x);
    float alpha = transparent != 0 ? clamp(covered[3u * p], 0.0, 1.0) : 1.0, own = nearest[p].w;
    vec2 found = vec2(uintBitsToFloat(INFINITY_BITS), 0.0);
    if (alpha > 0.0) found = own > 0.0 || (own == 0.0 && transparent == 0) ? nearest[p].xw : nearest_around(at);
    if (transparent != 0 && own == 0.0 && floatBitsToUint(found.x) == INFINITY_BITS) {
        alpha = 0.0;
        for (uint c = 0u; c < 3u; c++) shown[3u * p + c] = 0.0;
    }
    vec3 direction = corner + float(at.x) * across + float(at.y) * down;
    channels[p] = found.x < FAR ? floatBitsToUint(found.x * length(direction)) : INFINITY_BITS;
    channels[count + p] = uint(found.y);
    channels[2u * count + p] = floatBitsToUint(alpha);
}
