// Samples of objects whose light changed, lit anew: all but who is in whose shadow, as kernels_relight says it.
layout(std430, binding = 0) readonly buffer Place { float place[]; };
layout(std430, binding = 1) readonly buffer Name { uint name[]; };
layout(std430, binding = 2) writeonly buffer Colour { float colour[]; };
layout(std430, binding = 3) readonly buffer Surface { int surface[]; };  // normal (2 x 8 bits), visible lights (16)
layout(std430, binding = 4) readonly buffer Albedo { float albedo[]; };  // below 0: not known
layout(std430, binding = 5) readonly buffer Objects { vec4 objects[]; };  // world's y axis, whether the light changed
layout(std430, binding = 6) readonly buffer Lamps { float lamps[]; };  // of one object after the other, suns first
layout(std430, binding = 7) readonly buffer Sky { float sky[]; };  // by the normal's height from -1 to 1
uniform int lights;  // of an object
uniform int suns;
uniform int steps;  // of the sky

vec3 normal_of(int bits) {
    vec2 uv = vec2(bitfieldExtract(bits, 0, 8), bitfieldExtract(bits, 8, 8)) * (1.0 / NORMAL_STEPS);
    float z = 1.0 - abs(uv.x) - abs(uv.y), fold = max(-z, 0.0);
    return normalize(vec3(uv.x - (uv.x >= 0.0 ? fold : -fold), uv.y - (uv.y >= 0.0 ? fold : -fold), z));
}

vec3 sky_at(int i) { return vec3(sky[3 * i], sky[3 * i + 1], sky[3 * i + 2]); }

vec3 from_lamp(int row, bool sun, vec3 point, vec3 normal) {
    vec3 to = vec3(lamps[row], lamps[row + 1], lamps[row + 2]);
    if (!sun) to -= point;
    float square = dot(to, to), weight = sun ? 1.0 : 1.0 / (square * sqrt(square));
    return weight * max(dot(normal, to), 0.0) * vec3(lamps[row + 3], lamps[row + 4], lamps[row + 5]);
}

void main() {
    uint k = item();
    if (k >= count || objects[name[k]].w == 0.0 || albedo[3 * k] < 0.0) return;
    vec3 point = vec3(place[3 * k], place[3 * k + 1], place[3 * k + 2]), normal = normal_of(surface[k]);
    float height = (dot(normal, objects[name[k]].xyz) + 1.0) * 0.5 * float(steps);
    int i = clamp(int(height), 0, steps - 1);
    vec3 light = mix(sky_at(i), sky_at(i + 1), height - float(i));
    for (int n = 0; n < lights; n++) {
        if ((surface[k] >> (16 + n) & 1) == 0) continue;
        light += from_lamp(LAMP_WORDS * (int(name[k]) * lights + n), n < suns, point, normal);
    }
    vec3 own = vec3(albedo[3 * k], albedo[3 * k + 1], albedo[3 * k + 2]);
    if (!(own.r + own.g + own.b > 0.0)) return;
    for (uint c = 0u; c < 3u; c++) colour[3 * k + c] = own[c] * light[c];
}
