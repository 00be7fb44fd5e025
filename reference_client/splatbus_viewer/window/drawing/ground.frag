#version 330 core

in vec3 facing, albedo, eye;
layout(location = 0) out vec4 color;
layout(location = 1) out float depth;

const vec3 LIGHT = normalize(vec3(-0.45, -0.6, -0.66));  // from where it comes, in camera axes

void main() {
  bool is_lit = dot(facing, facing) > 0.0;
  float light = is_lit ? 0.45 + 0.55 * max(dot(normalize(facing), LIGHT), 0.0) : 1.0;
  color = vec4(albedo * light, 1.0);
  depth = eye.z;
}
