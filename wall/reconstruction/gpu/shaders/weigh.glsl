// Every sample: what is hidden waits or is rejected, what is too old is evicted; the visible are weighed by confidence
// and age.
layout(std430, binding = 0) buffer State { float state[]; };  // time, confidence
layout(std430, binding = 1) buffer ScreenPosition { float screen[]; };  // x, y, depth
layout(std430, binding = 2) writeonly buffer Weight { float weight[]; };
layout(std430, binding = 3) readonly buffer Nearest { vec4 nearest[]; };  // depth (inf: none), x, y, object id
layout(std430, binding = 4) readonly buffer Bounds { float bounds[]; };  // conservative depth, decay, density
layout(std430, binding = 5) readonly buffer Ages { uint ages[]; };
layout(std430, binding = 6) readonly buffer ObjectId { uint object_id[]; };
uniform ivec2 size;
uniform int evicts;  // 1: ages[AGES] is the last age that stays
uniform float now;
uniform float young;
uniform float behind_own;  // see kernels.visibility.Behind
uniform float behind_other;

float ratio(vec4 other, float own) { return other.w == own ? behind_own : behind_other; }

bool hidden(vec3 at, float own) {
    ivec2 pixel = ivec2(at.xy);
    bool everywhere = true;
    float nearer = 0.0, empty = 0.0;
    vec2 sum = vec2(0.0);
    for (int y = max(pixel.y - 1, 0); y < min(pixel.y + 2, size.y); y++) {
        for (int x = max(pixel.x - 1, 0); x < min(pixel.x + 2, size.x); x++) {
            vec4 other = nearest[y * size.x + x];
            if (other.w < 0.0) empty += 1.0;
            if (!(other.x * ratio(other, own) < at.z)) {
                everywhere = false;
                continue;
            }
            vec2 d = other.yz - at.xy;
            if (dot(d, d) < COVERS) return true;
            nearer += 1.0;
            sum += d;
        }
    }
    if (everywhere) return true;
    vec4 shown = nearest[pixel.y * size.x + pixel.x];
    if (nearer < SLOT - EMPTY * empty && shown.x * ratio(shown, own) >= at.z) return false;
    float reach = AMIDST * nearer + ALONE;
    return nearer > 0.0 && dot(sum, sum) < reach * reach;
}

void main() {
    uint k = item();
    if (k >= count) return;
    vec3 at = vec3(screen[3 * k + X], screen[3 * k + Y], screen[3 * k + DEPTH]);
    weight[k] = 0.0;
    if (!(at.z > 0.0)) return;
    float age = now - state[2 * k + TIME];
    bool old = evicts != 0 && floatBitsToUint(max(age, 0.0)) >> AGE_SHIFT > ages[AGES];
    int shown = int(at.y) * size.x + int(at.x), pixel = 3 * shown;
    float own = float(object_id[k]), closer = nearest[shown].w == own ? 1.0 : behind_own / behind_other;
    bool covered = at.z * closer > bounds[pixel] && age > young && hidden(at, own);
    if (covered && age < WAIT_S && !old) return;
    if (covered || old) {
        screen[3 * k + DEPTH] = OUTSIDE;
        state[2 * k + CONFIDENCE] = 0.0;
        return;
    }
    float a = max(age, 0.0) * bounds[pixel + 1];
    weight[k] = state[2 * k + CONFIDENCE] / (1.0 + a * (1.0 + a * (0.5 + a / 6.0)));
}
