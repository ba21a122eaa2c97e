// Interpolate the coarser level at a pixel centre: bilinear, weights 9 3 3 1 of 16.
layout(binding = 0) uniform sampler2D filled;

vec3 interpolate(ivec2 at) {
    ivec2 near = at / 2, far = clamp(near - 1 + 2 * (at % 2), ivec2(0), textureSize(filled, 0) - 1);
    return (9.0 * texelFetch(filled, near, 0).rgb + 3.0 * texelFetch(filled, ivec2(far.x, near.y), 0).rgb
        + 3.0 * texelFetch(filled, ivec2(near.x, far.y), 0).rgb + texelFetch(filled, far, 0).rgb) / 16.0;
}
