// Publishes one image: reads each number of the source once, writes each byte of the slot once.
//
// A slot's row j takes image row height - 1 - j [BUF-1], so pixel p of the slot, counted row by row,
// is read from where the strides of the source say that it lies: channels first or last, contiguous
// or not, are all the same here. A thread takes one pixel, neighbouring threads neighbouring pixels;
// more pixels a thread were no faster on an H100 or an H200.
//
// Macros (kernels.py) say what the source is: CHANNELS 3 or 4; COLOR_HALF, DEPTH_HALF, ALPHA_HALF
// 0 or 1; PACKED 1 where the four channels of a pixel are one aligned vector; DEPTH 0 none, 1 z,
// 2 the sum of 1/z, 3 the sum of z, both weighted; ALPHA 1 where a plane of it is given;
// PREMULTIPLIED 1 where the colour is. THREADS are in a block.

typedef unsigned short Half;

#if COLOR_HALF
typedef Half Color;
typedef ushort4 Color4;
#else
typedef float Color;
typedef float4 Color4;
#endif
#if DEPTH_HALF
typedef Half Depth;
#else
typedef float Depth;
#endif
#if ALPHA_HALF
typedef Half Alpha;
#else
typedef float Alpha;
#endif

// Strides in numbers, not bytes.
struct Plane {
  const void* data;
  long long row, column;
};

struct Image {
  Plane color;
  long long channel;
  Plane depth;
  Plane alpha;
  float4* slot_color;
  float* slot_depth;
  unsigned width, height;
  float empty;
};

struct Pixel {
  float4 color;
  float depth, alpha;
};

__device__ __forceinline__ float widened(float number) { return number; }

__device__ __forceinline__ float widened(Half bits) {
  float number;
  asm("cvt.f32.f16 %0, %1;" : "=f"(number) : "h"(bits));
  return number;
}

// Nothing here need stay in the cache, and to say so saves up to 2 % where a pixel is one vector.
// Where its channels are read one by one, neighbours share what the cache holds, and it costs 3 %.
template <typename Value>
__device__ __forceinline__ Value fetched(const Value* from) {
#if PACKED
  return __ldcs(from);
#else
  return __ldg(from);
#endif
}

template <typename Value>
__device__ __forceinline__ void put(Value* to, Value value) {
#if PACKED
  __stcs(to, value);
#else
  *to = value;
#endif
}

template <typename Number>
__device__ __forceinline__ float read(const void* data, long long offset) {
  return widened(fetched(static_cast<const Number*>(data) + offset));
}

template <bool WITH_COLOR, bool WITH_DEPTH>
__device__ __forceinline__ Pixel loaded(const Image& image, unsigned row, unsigned column) {
  Pixel pixel;
  pixel.color = make_float4(0.0f, 0.0f, 0.0f, 1.0f);
  pixel.alpha = 1.0f;
  pixel.depth = 0.0f;
  const long long at = row * image.color.row + column * image.color.column;
  if (WITH_COLOR) {
#if PACKED
    const Color4 color = fetched(
        reinterpret_cast<const Color4*>(static_cast<const Color*>(image.color.data) + at));
    pixel.color = make_float4(widened(color.x), widened(color.y), widened(color.z),
                              widened(color.w));
#else
    pixel.color.x = read<Color>(image.color.data, at);
    pixel.color.y = read<Color>(image.color.data, at + image.channel);
    pixel.color.z = read<Color>(image.color.data, at + 2 * image.channel);
#if CHANNELS == 4
    pixel.color.w = read<Color>(image.color.data, at + 3 * image.channel);
#endif
#endif
  }
#if ALPHA
  if (WITH_DEPTH || (CHANNELS == 3 && PREMULTIPLIED))
    pixel.alpha = read<Alpha>(image.alpha.data,
                              row * image.alpha.row + column * image.alpha.column);
#elif CHANNELS == 4
  pixel.alpha = WITH_COLOR ? pixel.color.w
                           : read<Color>(image.color.data, at + 3 * image.channel);
#endif
#if ALPHA && CHANNELS == 3 && PREMULTIPLIED
  pixel.color.w = pixel.alpha;  // premultiplied colour has no background in it, so this is its own
#endif
#if DEPTH
  if (WITH_DEPTH)
    pixel.depth = read<Depth>(image.depth.data,
                              row * image.depth.row + column * image.depth.column);
#endif
  return pixel;
}

// Clamped to [0, 1] [BUF-3]; (0, 0, 0, 0) where a channel is NaN.
template <bool STRAIGHT>
__device__ __forceinline__ float4 stored(float4 color) {
  const bool is_number = color.x == color.x && color.y == color.y && color.z == color.z &&
                         color.w == color.w;
  if (!is_number) return make_float4(0.0f, 0.0f, 0.0f, 0.0f);
#if PREMULTIPLIED
  if (STRAIGHT && color.w > 0.0f) {
    color.x = __fdiv_rn(color.x, color.w);
    color.y = __fdiv_rn(color.y, color.w);
    color.z = __fdiv_rn(color.z, color.w);
  }
#endif
  return make_float4(__saturatef(color.x), __saturatef(color.y), __saturatef(color.z),
                     __saturatef(color.w));
}

// The depth of a covered pixel, rounded once [ACC-8]; `empty` elsewhere [ACC-9, BUF-7].
__device__ __forceinline__ float surface(float depth, float alpha, float empty) {
  const float largest = 3.402823466e+38f;
  const float least_alpha = 0.00392156886f;  // 1/255 rounded up: no float lies between them
  const bool is_covered = depth > 0.0f && depth <= largest && alpha >= least_alpha &&
                          alpha <= largest;
  if (!is_covered) return empty;
#if DEPTH == 2
  depth = __fdiv_rn(alpha, depth);
#elif DEPTH == 3
  depth = __fdiv_rn(depth, alpha);
#endif
  return depth > 0.0f ? fminf(depth, largest) : empty;  // a quotient can vanish
}

template <bool WITH_COLOR, bool WITH_DEPTH, bool STRAIGHT>
__device__ __forceinline__ void publish(const Image& image) {
  const unsigned p = blockIdx.x * THREADS + threadIdx.x;
  if (p >= image.width * image.height) return;
  const unsigned row = p / image.width;
  const Pixel pixel = loaded<WITH_COLOR, WITH_DEPTH>(image, image.height - 1 - row,
                                                     p - row * image.width);
  if (WITH_COLOR) put(image.slot_color + p, stored<STRAIGHT>(pixel.color));
  if (WITH_DEPTH)
    put(image.slot_depth + p, surface(pixel.depth, pixel.alpha, image.empty));
}

#define KERNEL(NAME, WITH_COLOR, WITH_DEPTH, STRAIGHT)                        \
  extern "C" __global__ void __launch_bounds__(THREADS)                       \
      NAME(const __grid_constant__ Image image) {                             \
    publish<WITH_COLOR, WITH_DEPTH, STRAIGHT>(image);                         \
  }

KERNEL(color_depth, true, true, false)
KERNEL(color_only, true, false, false)
KERNEL(depth_only, false, true, false)
KERNEL(legacy, true, true, true)
