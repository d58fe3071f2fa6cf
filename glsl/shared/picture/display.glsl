// Conversions from radiance to display values. Twin of src/reference/display.rs.
#ifndef KDRAY_DISPLAY
#define KDRAY_DISPLAY

// The linear display value, 0..1.
vec3 displayed(vec3 radiance, float exposure) {
    return clamp(radiance * exposure, vec3(0.0), vec3(1.0));
}

// The relative luminance of the displayed colour, 0..1 (ITU-R BT.709).
float luminance(vec3 radiance, float exposure) {
    return dot(displayed(radiance, exposure), vec3(0.2126, 0.7152, 0.0722));
}

// Encodes linear values in 0..1 as sRGB (IEC 61966-2-1).
vec3 srgb_encode(vec3 linear) {
    vec3 low = linear * 12.92;
    vec3 high = 1.055 * pow(linear, vec3(1.0 / 2.4)) - 0.055;
    return mix(high, low, lessThanEqual(linear, vec3(0.0031308)));
}

#endif
