// SPDX-License-Identifier: MIT
// Images in OpenGL, without a window (EGL): what lies on the GPU goes there from CUDA to a texture by
// graphics interoperability, without the host; what lies in memory of the host is uploaded once. Splats
// stand before and behind a wall, by depth. Arguments: the PNG to write, and after how many images; the
// second is 1 without one. Where to connect stands in the environment, SPLATBUS_HOST and so on.
#define EGL_EGLEXT_PROTOTYPES
#define GL_GLEXT_PROTOTYPES
#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <GL/gl.h>
#include <GL/glext.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <string>
#include <type_traits>

#include "png.hpp"
#include "splatbus/client.hpp"

namespace {

using namespace splatbus;

constexpr float wall_depth = 5;  ///< along the axis of view

constexpr const char* vertex_shader = R"(#version 330 core
void main() {
  gl_Position = vec4(gl_VertexID == 1 ? 3 : -1, gl_VertexID == 2 ? 3 : -1, 0, 1);
})";

/// As compositing.hpp does it, over a wall of squares of 8 pixels.
constexpr const char* pixel_shader = R"(#version 330 core
uniform sampler2D color, depth;
uniform bool is_straight, is_linear, is_ray;
uniform vec4 lens;
uniform float wall_depth, empty;
out vec4 shown;
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  float squares = ((at.x >> 3) + (at.y >> 3)) % 2 == 0 ? 0.5 : 0.25;
  vec4 splats = texelFetch(color, at, 0);
  float z = texelFetch(depth, at, 0).r;
  float height = float(textureSize(color, 0).y);
  bool is_surface = z > 0.0 && !isinf(z) && z != empty;
  vec2 ray = (vec2(float(at.x), height - 1.0 - float(at.y)) + 0.5 - lens.zw) / lens.xy;
  if (is_ray) z /= sqrt(1.0 + dot(ray, ray));
  bool is_before = splats.a > 0.0 && is_surface && z < wall_depth;
  vec3 light = is_straight ? splats.rgb * splats.a : splats.rgb;
  vec3 mixed = is_before ? light + (1.0 - splats.a) * squares : vec3(squares);
  vec3 encoded = mix(1.055 * pow(mixed, vec3(1.0 / 2.4)) - 0.055, 12.92 * mixed, lessThanEqual(mixed, vec3(0.0031308)));
  shown = vec4(is_linear ? encoded : mixed, 1.0);
})";

[[noreturn]] void give_up(const std::string& why) {
  std::fprintf(stderr, "%s\n", why.c_str());
  std::exit(1);
}

/// An OpenGL context on the GPU that images lie on, or on any for those of the host.
void make_context(const cuda::Device* device) {
  const auto query = reinterpret_cast<PFNEGLQUERYDEVICESEXTPROC>(eglGetProcAddress("eglQueryDevicesEXT"));
  const auto attribute = reinterpret_cast<PFNEGLQUERYDEVICEATTRIBEXTPROC>(eglGetProcAddress("eglQueryDeviceAttribEXT"));
  const auto display_of = reinterpret_cast<PFNEGLGETPLATFORMDISPLAYEXTPROC>(eglGetProcAddress("eglGetPlatformDisplayEXT"));
  EGLDeviceEXT found[16];
  EGLint devices = 0;
  if (query == nullptr || attribute == nullptr || display_of == nullptr || !query(16, found, &devices)) give_up("EGL lists no devices");
  EGLDisplay display = EGL_NO_DISPLAY;
  for (int i = 0; i < devices && display == EGL_NO_DISPLAY; ++i) {
    EGLAttrib ordinal = -1;
    const bool is_that = device == nullptr || (attribute(found[i], EGL_CUDA_DEVICE_NV, &ordinal) && ordinal == device->ordinal);
    if (is_that) display = display_of(EGL_PLATFORM_DEVICE_EXT, found[i], nullptr);
  }
  if (display == EGL_NO_DISPLAY) give_up("EGL knows no such device" + (device != nullptr ? " as number " + std::to_string(device->ordinal) + " of CUDA" : std::string()));
  if (!eglInitialize(display, nullptr, nullptr)) give_up("EGL does not begin");
  eglBindAPI(EGL_OPENGL_API);
  constexpr EGLint wanted[] = {EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_SURFACE_TYPE, EGL_PBUFFER_BIT, EGL_NONE};
  constexpr EGLint version[] = {EGL_CONTEXT_MAJOR_VERSION, 3, EGL_CONTEXT_MINOR_VERSION, 3, EGL_NONE};
  EGLConfig config = nullptr;
  EGLint count = 0;
  eglChooseConfig(display, wanted, &config, 1, &count);
  const EGLContext context = eglCreateContext(display, config, EGL_NO_CONTEXT, version);
  if (context == EGL_NO_CONTEXT || !eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context)) give_up("there is no OpenGL 3.3 here");
  std::printf("OpenGL of %s\n", reinterpret_cast<const char*>(glGetString(GL_RENDERER)));
}

/// A texture that takes a plane of each image.
class Texture {
 public:
  Texture(GLenum format, GLenum kind, std::int64_t width, std::int64_t height) : kind_(kind), width_(static_cast<GLsizei>(width)), height_(static_cast<GLsizei>(height)) {
    glGenTextures(1, &name_);
    glBindTexture(GL_TEXTURE_2D, name_);
    glTexStorage2D(GL_TEXTURE_2D, 1, format, width_, height_);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
  }

  Texture(const Texture&) = delete;
  Texture& operator=(const Texture&) = delete;
  ~Texture() {
    if (resource_ != nullptr) forget_(resource_);
    glDeleteTextures(1, &name_);
  }

  void upload(const float* numbers) const {
    glBindTexture(GL_TEXTURE_2D, name_);
    glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, width_, height_, kind_, GL_FLOAT, numbers);
  }

  /// From there to the texture, in the order of a stream; whether all was done. What OpenGL does next comes after it.
  bool copy(const cuda::Device& device, cuda::Address from, cuda::Stream stream) {
    const Interop calls(device.driver);
    constexpr unsigned write_discard = 2;
    const std::size_t row = static_cast<std::size_t>(width_) * (kind_ == GL_RGBA ? 16 : 4);
    Copy copy{};
    copy.from_type = 2;  // CU_MEMORYTYPE_DEVICE
    copy.from_device = from;
    copy.from_pitch = copy.width = row;
    copy.to_type = 3;  // CU_MEMORYTYPE_ARRAY
    copy.height = static_cast<std::size_t>(height_);
    forget_ = calls.forget;
    if (resource_ == nullptr && calls.enlist(&resource_, name_, GL_TEXTURE_2D, write_discard) != 0) return false;
    if (calls.map(1, &resource_, stream) != 0) return false;
    const bool is_done = calls.array_of(&copy.to_array, resource_, 0, 0) == 0 && calls.copy(&copy, stream) == 0;
    return calls.unmap(1, &resource_, stream) == 0 && is_done;
  }

  GLuint name() const { return name_; }

 private:
  /// CUDA_MEMCPY2D.
  struct Copy {
    std::size_t from_x, from_y;
    int from_type;
    const void* from_host;
    cuda::Address from_device;
    void* from_array;
    std::size_t from_pitch, to_x, to_y;
    int to_type;
    void* to_host;
    cuda::Address to_device;
    void* to_array;
    std::size_t to_pitch, width, height;
  };
  using Resource = void*;
  struct Interop {
    int (*enlist)(Resource*, GLuint, GLenum, unsigned);
    int (*forget)(Resource);
    int (*map)(unsigned, Resource*, cuda::Stream);
    int (*unmap)(unsigned, Resource*, cuda::Stream);
    int (*array_of)(void**, Resource, unsigned, unsigned);
    int (*copy)(const Copy*, cuda::Stream);
    explicit Interop(const cuda::Driver& driver) {
      const auto find = [&](auto& to, const char* name) { to = driver.function<std::decay_t<decltype(to)>>(name); };
      find(enlist, "cuGraphicsGLRegisterImage");
      find(forget, "cuGraphicsUnregisterResource");
      find(map, "cuGraphicsMapResources");
      find(unmap, "cuGraphicsUnmapResources");
      find(array_of, "cuGraphicsSubResourceGetMappedArray");
      find(copy, "cuMemcpy2DAsync_v2");
      if (!enlist || !forget || !map || !unmap || !array_of || !copy) give_up("the CUDA driver knows no OpenGL");
    }
  };

  GLenum kind_;
  GLsizei width_, height_;
  GLuint name_ = 0;
  Resource resource_ = nullptr;
  int (*forget_)(Resource) = nullptr;
};

GLuint compiled(GLenum kind, const char* text) {
  const GLuint shader = glCreateShader(kind);
  glShaderSource(shader, 1, &text, nullptr);
  glCompileShader(shader);
  GLint is_good = 0;
  glGetShaderiv(shader, GL_COMPILE_STATUS, &is_good);
  std::string why(1000, '\0');
  if (!is_good) glGetShaderInfoLog(shader, 1000, nullptr, why.data()), give_up(why);
  return shader;
}

/// What is drawn into, and with what.
class Stage {
 public:
  explicit Stage(const FrameLease& lease)
      : width_(static_cast<GLsizei>(lease.packet().meta.w)), height_(static_cast<GLsizei>(lease.packet().meta.h)),
        color_(GL_RGBA32F, GL_RGBA, width_, height_), depth_(GL_R32F, GL_RED, width_, height_) {
    glGenRenderbuffers(1, &target_);
    glBindRenderbuffer(GL_RENDERBUFFER, target_);
    glRenderbufferStorage(GL_RENDERBUFFER, GL_RGBA8, width_, height_);
    glGenFramebuffers(1, &framebuffer_);
    glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, target_);
    glGenVertexArrays(1, &array_);
    glBindVertexArray(array_);
    program_ = glCreateProgram();
    glAttachShader(program_, compiled(GL_VERTEX_SHADER, vertex_shader));
    glAttachShader(program_, compiled(GL_FRAGMENT_SHADER, pixel_shader));
    glLinkProgram(program_);
    glUseProgram(program_);
    glViewport(0, 0, width_, height_);
    glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
    glPixelStorei(GL_PACK_ALIGNMENT, 1);
  }

  Stage(const Stage&) = delete;
  Stage& operator=(const Stage&) = delete;
  ~Stage() {
    glDeleteProgram(program_);
    glDeleteVertexArrays(1, &array_);
    glDeleteFramebuffers(1, &framebuffer_);
    glDeleteRenderbuffers(1, &target_);
  }

  bool fits(const FrameLease& lease) const { return lease.packet().meta.w == width_ && lease.packet().meta.h == height_; }

  /// On this stream, which is made for the first image on a GPU; the end of each lease waits for it.
  void take(const FrameLease& lease, cuda::Stream& stream) {
    if (const cuda::Device* device = lease.device()) {
      const cuda::Device::Current current(*device);
      if (stream == nullptr) device->driver.stream_create(&stream, 1);
      const bool is_done = color_.copy(*device, lease.color_on_device(stream), stream) && depth_.copy(*device, lease.depth_on_device(stream), stream);
      if (!is_done) give_up("CUDA refuses the copy to OpenGL");
    } else {
      color_.upload(lease.color());
      depth_.upload(lease.depth());
    }
  }

  void draw(const FrameLease& lease) const {
    const Semantics& semantics = lease.packet().semantics;
    const FrameCamera& camera = lease.frame().camera;
    glActiveTexture(GL_TEXTURE0);
    glBindTexture(GL_TEXTURE_2D, color_.name());
    glActiveTexture(GL_TEXTURE1);
    glBindTexture(GL_TEXTURE_2D, depth_.name());
    glUniform1i(place("depth"), 1);
    glUniform1i(place("is_straight"), semantics.alpha == SemanticsAlpha::straight);
    glUniform1i(place("is_linear"), semantics.colorSpace == SemanticsColorSpace::linear);
    glUniform1i(place("is_ray"), lease.has_camera() && semantics.depth.kind == DepthSemanticsKind::ray_distance);
    glUniform4f(place("lens"), static_cast<float>(camera.fx), static_cast<float>(camera.fy), static_cast<float>(camera.cx), static_cast<float>(camera.cy));
    glUniform1f(place("wall_depth"), wall_depth);
    glUniform1f(place("empty"), static_cast<float>(semantics.depth.empty));
    glDrawArrays(GL_TRIANGLES, 0, 3);
    glFinish();
  }

  bool write(const char* path) const {
    const std::size_t row = 3 * static_cast<std::size_t>(width_);
    std::string pixels(row * static_cast<std::size_t>(height_), '\0'), rows;
    glReadPixels(0, 0, width_, height_, GL_RGB, GL_UNSIGNED_BYTE, pixels.data());
    for (auto each = static_cast<std::size_t>(height_); each-- > 0;) (rows += '\0').append(pixels, each * row, row);
    return png::save(path, static_cast<std::size_t>(width_), static_cast<std::size_t>(height_), rows);
  }

 private:
  GLint place(const char* name) const { return glGetUniformLocation(program_, name); }

  GLsizei width_, height_;
  Texture color_, depth_;
  GLuint program_ = 0, target_ = 0, framebuffer_ = 0, array_ = 0;
};

}  // namespace

int main(int count, char** arguments) {
  if (count < 2 || count > 3 || arguments[1][0] == '-') give_up("gl_viewer FILE.png [IMAGES]");
  const long images = count > 2 ? std::atol(arguments[2]) : 1;
  Client client(ClientOptions::from_environment());
  std::optional<Stage> stage;
  cuda::Stream stream = nullptr;
  double seconds = 0;
  const auto began = std::chrono::steady_clock::now();
  for (long taken = 0; taken < images;) {
    Pose pose;
    pose.position = {0.1 * std::sin(0.1 * static_cast<double>(taken)), 0, -4};
    client.send_camera(pose);
    const FrameLease lease = client.take_frame(std::chrono::seconds(1));
    if (!lease && std::chrono::steady_clock::now() - began > std::chrono::seconds(60)) give_up("no image: " + client.status().problem);
    if (!lease) continue;
    if (!stage) make_context(lease.device());
    if (!stage || !stage->fits(lease)) stage.emplace(lease);
    const auto before = std::chrono::steady_clock::now();
    stage->take(lease, stream);
    stage->draw(lease);
    seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - before).count();
    if (++taken == images) std::printf("%ld images %s, %.3f ms each to take and draw\n", images, lease.device() != nullptr ? "from CUDA" : "from memory of the host", 1000 * seconds / static_cast<double>(images));
  }
  return stage->write(arguments[1]) ? 0 : 1;
}
