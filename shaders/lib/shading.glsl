// Light on a voxel, in linear light RGB.

// IEC 61966-2-1.
vec3 linear_from_srgb(vec3 c) {
  return mix(pow((c + 0.055) / 1.055, vec3(2.4)), c / 12.92, lessThanEqual(c, vec3(0.04045)));
}

vec3 srgb_from_linear(vec3 c) {
  c = clamp(c, vec3(0.0), vec3(1.0));
  return mix(1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, c * 12.92,
             lessThanEqual(c, vec3(0.0031308)));
}

// Of grids without colours: a warm light grey, sRGB 214 205 192.
const vec3 SHADING_NEUTRAL = vec3(0.672, 0.610, 0.527);

vec3 face_normal(int face) {
  vec3 axis = vec3(equal(ivec3(face / 2), ivec3(0, 1, 2)));
  return (face % 2 == 0) ? -axis : axis;
}

// Each direction of faces has a brightness of its own, independent of camera and light, so that
// colours can be compared from picture to picture: top 1, bottom 0.5, sides 0.78 and 0.64.
float flat_light(vec3 normal) {
  vec3 weight = normal * normal;
  return weight.x * 0.78 + weight.y * (normal.y > 0.0 ? 1.0 : 0.5) + weight.z * 0.64;
}

// Phong, "Illumination for Computer Generated Pictures" (1975), with a key light, a weaker light
// from the opposite side of the camera, and ambient light that is brighter from above.
// Unit vectors; `normal` faces the eye.
vec3 phong_light(vec3 albedo, vec3 normal, vec3 to_eye, vec3 to_light) {
  float key = max(dot(normal, to_light), 0.0);
  float fill = max(dot(normal, normalize(2.0 * dot(to_light, to_eye) * to_eye - to_light)), 0.0);
  float ambient = 0.16 + 0.06 * normal.y;
  vec3 mirrored = 2.0 * dot(normal, to_light) * normal - to_light;
  float highlight = key > 0.0 ? pow(max(dot(mirrored, to_eye), 0.0), 24.0) : 0.0;
  return albedo * (ambient + 0.72 * key + 0.18 * fill) + vec3(0.06 * highlight);
}
