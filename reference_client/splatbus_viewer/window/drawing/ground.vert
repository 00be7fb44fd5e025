#version 330 core

uniform mat4 to_camera, projection;
in vec3 position;
in vec3 normal;
in vec3 tint;
out vec3 facing, albedo, eye;

void main() {
  vec4 seen = to_camera * vec4(position, 1.0);
  eye = seen.xyz;
  facing = mat3(to_camera) * normal;
  albedo = tint;
  gl_Position = projection * seen;
}
