// Light the samples of objects anew whose light changed: everything but shadows, as kernels/relight.py does.
layout(std430, binding = 0) readonly buffer Position { float position[]; };
layout(std430, binding = 1) readonly buffer ObjectId { uint object_id[]; };
layout(std430, binding = 2) writeonly buffer Radiance { float radiance[]; };
layout(std430, binding = 3) readonly buffer Surface { uint surface[]; };  // packed normal, light visibility mask
layout(std430, binding = 4) readonly buffer Albedo { float albedo[]; };  // below 0: not known
layout(std430, binding = 5) readonly buffer Objects { vec4 objects[]; };  // world's y axis, whether the light changed
layout(std430, binding = 6) readonly buffer Lights { float lights[]; };  // of one object after the other
layout(std430, binding = 7) readonly buffer Sky { float sky[]; };  // irradiance by the normal's height from -1 to 1
uniform int lights_per_object;
uniform int directional;  // of them, the first
uniform int steps;  // of the sky

vec3 normal_of(int bits) {
    vec2 uv = vec2(bitfieldExtract(bits, 0, 8), bitfieldExtract(bits, 8, 8)) * (1.0 / NORMAL_STEPS);
    float z = 1.0 - abs(uv.x) - abs(uv.y), fold = max(-z, 0.0);
    return normalize(vec3(uv.x - (uv.x >= 0.0 ? fold : -fold), uv.y - (uv.y >= 0.0 ? fold : -fold), z));
}

vec3 sky_at(int i) { return vec3(sky[3 * i], sky[3 * i + 1], sky[3 * i + 2]); }

vec3 from_light(int row, bool is_direction, vec3 point, vec3 normal) {
    vec3 to = vec3(lights[row], lights[row + 1], lights[row + 2]);
    if (!is_direction) to -= point;
    float square = max(dot(to, to), LEAST_SQUARE), weight = is_direction ? 1.0 : 1.0 / (square * sqrt(square));
    return weight * max(dot(normal, to), 0.0) * vec3(lights[row + 3], lights[row + 4], lights[row + 5]);
}

void main() {
    uint k = item();
    if (k >= count || objects[object_id[k]].w == 0.0 || albedo[3 * k] < 0.0) return;
    vec3 point = vec3(position[3 * k + X], position[3 * k + Y], position[3 * k + Z]);
    vec3 normal = normal_of(int(surface[2 * k + NORMAL]));
    float height = (dot(normal, objects[object_id[k]].xyz) + 1.0) * 0.5 * float(steps);
    int i = clamp(int(height), 0, steps - 1);
    vec3 light = mix(sky_at(i), sky_at(i + 1), height - float(i));
    for (int n = 0; n < lights_per_object; n++) {
        if ((surface[2 * k + VISIBILITY] >> n & 1u) == 0u) continue;
        light += from_light(LIGHT_WORDS * (int(object_id[k]) * lights_per_object + n), n < directional, point, normal);
    }
    vec3 own = vec3(albedo[3 * k], albedo[3 * k + 1], albedo[3 * k + 2]);
    if (!(own.r + own.g + own.b > 0.0)) return;
    for (uint c = 0u; c < 3u; c++) radiance[3 * k + c] = own[c] * light[c];
}
