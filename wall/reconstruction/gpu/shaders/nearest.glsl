// Every pixel: its nearest sample in one vector. What it gathered while it stood still goes where what it shows moves
// or is lit anew, and shrinks where it was contradicted. Depths and doubts are wiped for the next refresh.
layout(std430, binding = 0) readonly buffer Screen { float screen[]; };
layout(std430, binding = 1) readonly buffer Name { uint name[]; };
layout(std430, binding = 2) readonly buffer Objects { float objects[]; };
layout(std430, binding = 3) buffer Pixels { uint pixels[]; };
layout(std430, binding = 4) buffer Doubt { uint doubt[]; };
layout(std430, binding = 5) writeonly buffer Nearest { vec4 nearest[]; };  // depth (inf: nothing), x, y, object
layout(rgba32f, binding = 0) uniform image2D still;  // sum of radiance, count
uniform int doubted;
uniform int wipe;  // 1: only that

void main() {
    uint p = item();
    if (p >= count) return;
    if (wipe == 0) {
        uint k = pixels[count + p];
        bool seen = k != 0xffffffffu;
        nearest[p] = seen ? vec4(screen[3 * k + 2], screen[3 * k], screen[3 * k + 1], float(name[k]))
                          : vec4(uintBitsToFloat(0x7f800000u), 0.0, 0.0, -1.0);
        ivec2 at = ivec2(int(p) % imageSize(still).x, int(p) / imageSize(still).x);
        if (!seen || objects[OBJECT_WORDS * name[k] + 13] != 0.0) {
            imageStore(still, at, vec4(0.0));
        } else if (doubted != 0) {
            float keep = 1.0 - uintBitsToFloat(doubt[p]);  // one doubt must outweigh many samples that agreed
            if (keep < 1.0) imageStore(still, at, imageLoad(still, at) * (keep * keep * keep));
        }
    }
    pixels[p] = 0x7f800000u;
    pixels[count + p] = 0xffffffffu;
    if (doubted != 0) {
        doubt[p] = 0u;
        doubt[count + p] = 0xffffffffu;
    }
}
