// Compiled for each MODE, for what an image's numbers mean, STRAIGHT, LINEAR, RAY, and for where it is
// PLACED: a processor that draws goes through all branches of what is decided while it runs, and the
// corner alone is a fifth of its work.
#define COLOR 0
#define DEPTH 1
#define NORMALS 2
#define COMPOSITE 3
#define PROBE 4
#define MOVED 1
#define SCALED 2

uniform sampler2D color, depth;                // of the image, bottom row first
uniform sampler2D ground_color, ground_depth;  // of the viewer's own geometry, sRGB
uniform float empty;
uniform vec4 lens;                             // fx, fy, cx, cy
uniform ivec2 corner;                          // of the screen, where the image begins
uniform vec2 scale;                            // pixels of the image to one of the screen
uniform vec2 range;                            // nearest and farthest depth of the colours
uniform vec3 ramp[9];
out vec4 shown;

vec3 encoded(vec3 light) {
  return mix(1.055 * pow(light, vec3(1.0 / 2.4)) - 0.055, 12.92 * light, lessThanEqual(light, vec3(0.0031308)));
}

vec3 decoded(vec3 srgb) {
  return mix(pow((srgb + 0.055) / 1.055, vec3(2.4)), srgb / 12.92, lessThanEqual(srgb, vec3(0.04045)));
}

vec3 ray(ivec2 at) {
  float row = float(textureSize(depth, 0).y) - 1.0 - float(at.y);
  return vec3((vec2(float(at.x), row) + 0.5 - lens.zw) / lens.xy, 1.0);
}

// Planar depth; 0 where there is no surface [BUF-8, BUF-9].
float planar(ivec2 at) {
  float z = texelFetch(depth, at, 0).r;
  bool is_surface = z > 0.0 && !isinf(z) && z != empty && texelFetch(color, at, 0).a > 0.0;
  if (!is_surface) return 0.0;
#if RAY
  z /= length(ray(at));
#endif
  return z;
}

vec3 over(vec4 splats, vec3 behind) {
#if STRAIGHT
  return mix(behind, splats.rgb, splats.a);
#else
  return splats.rgb + (1.0 - splats.a) * behind;
#endif
}

// From the surface at a pixel to its neighbour's on the side whose depth is the more alike:
// differences across an edge belong to no surface.
vec3 along(ivec2 at, ivec2 step, float z) {
  float ahead = 0.0, back = 0.0;
  if (all(lessThan(at + step, textureSize(depth, 0)))) ahead = planar(at + step);
  if (all(greaterThanEqual(at - step, ivec2(0)))) back = planar(at - step);
  bool has_ahead = ahead > 0.0, has_back = back > 0.0;
  if (!has_ahead && !has_back) return vec3(0.0);
  bool takes_ahead = has_ahead && (!has_back || abs(ahead - z) <= abs(z - back));
  vec3 here = z * ray(at);
  return takes_ahead ? ahead * ray(at + step) - here : here - back * ray(at - step);
}

vec3 normals(ivec2 at) {
  float z = planar(at);
  vec3 across = cross(along(at, ivec2(1, 0), z), along(at, ivec2(0, 1), z));
  if (dot(across, across) == 0.0) return vec3(0.5);
  vec3 normal = normalize(across);
  if (dot(normal, ray(at)) > 0.0) normal = -normal;
  return 0.5 + 0.5 * vec3(normal.x, -normal.y, -normal.z);
}

vec3 false_color(float z) {
  float place = clamp((z - range.x) / (range.y - range.x), 0.0, 1.0) * 8.0;
  int stop = min(int(place), 7);
  return mix(ramp[stop], ramp[stop + 1], place - float(stop));
}

vec3 squares() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  return vec3(((at.x ^ at.y) & 8) == 0 ? 0.20 : 0.16);
}

vec3 hatched() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  return vec3((at.x + at.y) % 10 < 2 ? 0.30 : 0.16);
}

void main() {
#if PLACED == SCALED
  ivec2 at = ivec2((gl_FragCoord.xy - vec2(corner)) * scale);
#elif PLACED == MOVED
  ivec2 at = ivec2(gl_FragCoord.xy) - corner;
#else
  ivec2 at = ivec2(gl_FragCoord.xy);
#endif
#if MODE == PROBE
  shown = vec4(planar(at), 0.0, 0.0, 1.0);
#elif MODE == DEPTH
  float z = planar(at);
  shown = vec4(z == 0.0 ? hatched() : false_color(z), 1.0);
#elif MODE == NORMALS
  shown = vec4(planar(at) == 0.0 ? hatched() : normals(at), 1.0);
#else
  vec3 behind = squares();
  bool is_seen = true;
#if MODE == COMPOSITE
  float ground = texelFetch(ground_depth, at, 0).r, z = planar(at);
  if (ground > 0.0) behind = texelFetch(ground_color, at, 0).rgb;
  is_seen = z > 0.0 && (ground == 0.0 || z < ground);  // [ACC-10]
#endif
#if LINEAR
  behind = decoded(behind);
#endif
  vec3 mixed = is_seen ? over(texelFetch(color, at, 0), behind) : behind;
#if LINEAR
  mixed = encoded(mixed);
#endif
  shown = vec4(mixed, 1.0);
#endif
}
