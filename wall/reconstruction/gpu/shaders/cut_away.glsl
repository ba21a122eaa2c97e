// Samples beyond a plane of their object are rejected, as deepbuffer/kernels/cuts.py does.
layout(std430, binding = 0) readonly buffer Position { float position[]; };
layout(std430, binding = 1) readonly buffer ObjectId { uint object_id[]; };
layout(std430, binding = 2) buffer State { float state[]; };  // time, confidence
layout(std430, binding = 3) readonly buffer Planes { vec4 planes[]; };  // of one object after the other
uniform int planes_per_object;

void main() {
    uint k = item();
    if (k >= count) return;
    vec3 point = vec3(position[3 * k + X], position[3 * k + Y], position[3 * k + Z]);
    for (int n = 0; n < planes_per_object; n++) {
        vec4 plane = planes[int(object_id[k]) * planes_per_object + n];
        vec3 parts = plane.xyz * point, sizes = abs(parts);
        float beyond = parts.x + parts.y + parts.z - plane.w;
        if (beyond > CUT_NEAR * (sizes.x + sizes.y + sizes.z + abs(plane.w))) state[2 * k + CONFIDENCE] = 0.0;
    }
}
