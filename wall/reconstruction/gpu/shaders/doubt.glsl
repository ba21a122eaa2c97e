// Samples that saw the scene before an edit lose confidence, as deepbuffer/kernels/doubt.py does.
layout(std430, binding = 0) buffer State { float state[]; };  // time, confidence
layout(std430, binding = 1) readonly buffer ObjectId { uint object_id[]; };
layout(std430, binding = 2) readonly buffer Doubted { float doubted[]; };  // of each object
layout(std430, binding = 3) readonly buffer Albedo { float albedo[]; };  // below 0: not known; read where `unlit`
uniform int unlit;

void main() {
    uint k = item();
    if (k >= count) return;
    uint own = 2u * k + CONFIDENCE;
    float confidence = state[own];
    bool surface = object_id[k] != 0u && unlit != 0;
    if (confidence > 1.0) state[own] = 1.0;
    else if (confidence > DOUBT_LEAST && (doubted[object_id[k]] != 0.0 || (surface && albedo[3u * k] < 0.0)))
        state[own] = max(confidence * DOUBT_KEPT, DOUBT_LEAST);
}
