// Shading of a voxel, in linear light RGB.

// Conversion from sRGB (IEC 61966-2-1).
vec3 linear_from_srgb(vec3 c) {
  return mix(pow((c + 0.055f) / 1.055f, vec3(2.4f)), c / 12.92f,
             lessThanEqual(c, vec3(0.04045f)));
}

vec3 srgb_from_linear(vec3 c) {
  c = clamp(c, vec3(0.0f), vec3(1.0f));
  return mix(1.055f * pow(c, vec3(1.0f / 2.4f)) - 0.055f, c * 12.92f,
             lessThanEqual(c, vec3(0.0031308f)));
}

// Converts R | G << 8 | B << 16 in sRGB to linear light.
vec3 rgb_of_word(uint word) {
  return linear_from_srgb(vec3(uvec3(word, word >> 8, word >> 16) & 255u) / 255.0f);
}

// The colour of voxels without colours: a warm light grey, sRGB 214 205 192.
const vec3 SHADING_NEUTRAL = vec3(0.672f, 0.610f, 0.527f);

// The colour of a full shadow on the ground.
const vec3 SHADING_SHADOW = vec3(0.010f, 0.012f, 0.020f);

vec3 face_normal(int face) {
  vec3 axis = vec3(equal(ivec3(face / 2), ivec3(0, 1, 2)));
  return (face % 2 == 0) ? -axis : axis;
}

// The amount of light that reaches a point, each 0..1.
struct Exposure {
  float open;  // share of the light from all sides
  float lit;   // share of the key light
};

// Flat shading: each direction of faces has a fixed brightness, independent of camera and light.
// Colours can therefore be compared between images: top 1, bottom 0.5, sides 0.78 and 0.64.
float flat_light(vec3 normal, Exposure exposure) {
  vec3 weight = normal * normal;
  float light =
      weight.x * 0.78f + weight.y * (normal.y > 0.0f ? 1.0f : 0.5f) + weight.z * 0.64f;
  return light * exposure.open * mix(0.6f, 1.0f, exposure.lit);
}

// Brightens dark colours by up to `gain`, and leaves black and white as they are: the slope at 0 is
// `gain`, as in the tone mapping of Reinhard et al., "Photographic Tone Reproduction for Digital
// Images" (2002).
vec3 with_exposure(vec3 color, float gain) {
  return color * gain / (vec3(1.0f) + color * (gain - 1.0f));
}

// The colour of a section's cut: a warm tone of the voxel's own, hatched. `along`: pixels across
// the lines, `apart`: from line to line.
vec3 cut_color(vec3 albedo, float along, float apart) {
  vec3 tone = mix(albedo, vec3(0.80f, 0.33f, 0.16f), 0.45f);
  float at = fract(along / apart);
  return at < 0.28f ? tone * 0.55f : tone;
}

// Phong shading ("Illumination for Computer Generated Images", 1975) with a key light, a weaker
// light from the opposite side of the camera, and ambient light that is brighter from above. All
// vectors are unit vectors; `normal` faces the eye. Occluded corners also get less key light,
// because part of it stands for light that bounces off the surface. gloss: 1, or 0 for matte
// surfaces, which have no highlight and more ambient light.
vec3 phong_light(vec3 albedo, vec3 normal, vec3 to_eye, vec3 to_light, Exposure exposure,
                 float gloss) {
  float key = max(dot(normal, to_light), 0.0f);
  float fill = max(dot(normal, normalize(2.0f * dot(to_light, to_eye) * to_eye - to_light)), 0.0f);
  float ambient = mix(0.32f, 0.16f, gloss) + 0.06f * normal.y;
  vec3 mirrored = 2.0f * dot(normal, to_light) * normal - to_light;
  float highlight = key > 0.0f ? pow(max(dot(mirrored, to_eye), 0.0f), 24.0f) : 0.0f;
  float direct = exposure.lit * mix(0.5f, 1.0f, exposure.open);
  return albedo * ((ambient + 0.18f * fill) * exposure.open + 0.72f * key * direct) +
         vec3(0.06f * highlight * exposure.lit * gloss);
}
