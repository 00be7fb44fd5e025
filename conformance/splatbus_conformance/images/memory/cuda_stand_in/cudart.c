/* Devices, errors and memory: what clients and servers of SplatBus use of libcudart. */

#include "objects.h"

#define VERSION 13000

static int give(int *where, int value) {
    if (!where)
        return last_error = INVALID_VALUE;
    *where = value;
    return SUCCESS;
}

static int devices(void) {
    const char *count = getenv("SPLATBUS_STAND_IN_DEVICES");
    return count && atoi(count) > 1 ? atoi(count) : 1;
}

static int check_device(int which) {
    return which >= 0 && which < devices() ? SUCCESS : INVALID_DEVICE;
}

API int cudaGetDeviceCount(int *count) { return give(count, devices()); }
API int cudaGetDevice(int *which) { return give(which, device); }
API int cudaRuntimeGetVersion(int *version) { return give(version, VERSION); }
API int cudaDriverGetVersion(int *version) { return give(version, VERSION); }

API int cudaSetDevice(int which) {
    int code = check_device(which);
    enter();
    device = code ? device : which;
    return leave("SetDevice", code, "\"which\":%d", which);
}

API int cudaDeviceGetAttribute(int *value, int attribute, int which) {
    const int unified_addressing = 41, ipc_events = 125, most = 150;
    if (attribute < 1 || attribute > most)
        return give(NULL, INVALID_VALUE);
    if (check_device(which))
        return last_error = INVALID_DEVICE;
    return give(value, attribute == unified_addressing || attribute == ipc_events);
}

API int cudaDeviceGetPCIBusId(char *text, int length, int which) {
    if (!text || length < (int)sizeof "0000:00:00.0")
        return give(NULL, INVALID_VALUE);
    if (check_device(which))
        return last_error = INVALID_DEVICE;
    snprintf(text, (size_t)length, "0000:%02x:00.0", which & 0xff);
    return SUCCESS;
}

API int cudaDeviceSynchronize(void) {
    enter(); /* nothing is ever under way */
    return leave("DeviceSynchronize", SUCCESS, "\"which\":%d", device);
}

API int cudaDeviceReset(void) {
    enter();
    while (first())
        drop(first());
    return leave("DeviceReset", SUCCESS, "\"which\":%d", device);
}

API int cudaPeekAtLastError(void) { return last_error; }

API int cudaGetLastError(void) {
    int code = last_error;
    last_error = SUCCESS;
    return code;
}

#define ERROR_TEXT(symbol, code, name, text) {code, name, text},
static const struct text {
    int code;
    const char *name, *text;
} texts[] = {ERRORS(ERROR_TEXT){-1, "unrecognized error code", "unrecognized error code"}};

static const struct text *text_of(int code) {
    const struct text *each = texts;
    while (each->code != code && each->code >= 0)
        each++;
    return each;
}

API const char *cudaGetErrorName(int code) { return text_of(code)->name; }
API const char *cudaGetErrorString(int code) { return text_of(code)->text; }

/* Allocations */

static struct object *beginning(const void *pointer, enum kind kind) {
    struct object *object = containing(pointer);
    return object && object->address == pointer && object->kind == kind ? object : NULL;
}

static int leave_with(const char *call, int code, const struct object object) {
    return leave(call, code, "\"memory\":\"%s\",\"size\":%zu,\"opened\":%u", object.name,
                 object.size, object.opened);
}

static int allocate(const char *call, void **pointer, enum kind kind, size_t size) {
    enter();
    struct object *object = pointer && size ? create(kind, size) : NULL;
    int code = !pointer ? INVALID_VALUE : size && !object ? OUT_OF_MEMORY : SUCCESS;
    if (!code)
        *pointer = object ? object->address : NULL;
    return leave_with(call, code, object ? *object : (struct object){.size = size});
}

/* Give up memory that the program holds once or, if it was opened, several times. */
static int release(const char *call, void *pointer, enum kind kind) {
    enter();
    struct object *object = beginning(pointer, kind), was = {0};
    if (object) {
        object->opened--;
        was = *object;
        if (!object->opened)
            drop(object);
    }
    int done = object || (!pointer && kind != IMPORTED);
    return leave_with(call, done ? SUCCESS : INVALID_VALUE, was);
}

API int cudaMalloc(void **to, size_t size) { return allocate("Malloc", to, ALLOCATED, size); }
API int cudaMallocHost(void **to, size_t size) { return allocate("MallocHost", to, PINNED, size); }
API int cudaFree(void *pointer) { return release("Free", pointer, ALLOCATED); }
API int cudaFreeHost(void *pointer) { return release("FreeHost", pointer, PINNED); }
API int cudaIpcCloseMemHandle(void *at) { return release("IpcCloseMemHandle", at, IMPORTED); }

API int cudaIpcGetMemHandle(struct handle *handle, void *pointer) {
    enter();
    struct object *object = containing(pointer); /* its middle will do */
    if (!handle || !object || object->kind != ALLOCATED)
        return leave_with("IpcGetMemHandle", INVALID_VALUE, (struct object){0});
    write_handle(handle, object);
    return leave_with("IpcGetMemHandle", SUCCESS, *object);
}

API int cudaIpcOpenMemHandle(void **pointer, struct handle handle, unsigned flags) {
    const unsigned lazy_peer_access = 1;
    struct object *object = NULL;
    int code = INVALID_VALUE;
    enter();
    if (pointer && flags == lazy_peer_access)
        code = import(&handle, IMPORTED, &object);
    if (!code)
        *pointer = object->address;
    return leave_with("IpcOpenMemHandle", code, object ? *object : (struct object){0});
}

/* Copies */

struct plane {
    char *bytes;
    size_t pitch;
    const struct object *object; /* NULL for memory of the host */
    size_t offset;
};

/* Find where a plane of rows really is; 0 if a part of it is not there. */
static int locate(struct plane *plane, size_t width, size_t height) {
    size_t extent;
    if (!plane->bytes || __builtin_mul_overflow(height - 1, plane->pitch, &extent) ||
        __builtin_add_overflow(extent, width, &extent))
        return 0;
    if (!(plane->object = containing(plane->bytes)))
        return 1;
    plane->offset = (size_t)(plane->bytes - plane->object->address);
    plane->bytes = plane->object->bytes + plane->offset;
    return extent <= plane->object->size - plane->offset;
}

static int on_device(const struct plane *plane) {
    return plane->object && plane->object->kind & DEVICE_MEMORY;
}

static uint32_t adler32(uint32_t sum, const char *bytes, size_t count) {
    uint32_t low = sum & 0xFFFF, high = sum >> 16;
    while (count--) {
        low = (low + (unsigned char)*bytes++) % 65521;
        high = (high + low) % 65521;
    }
    return high << 16 | low;
}

static int check_copy(struct plane *to, struct plane *from, size_t width, size_t height, int kind) {
    enum { TO_DEVICE = 1, FROM_DEVICE = 2, ANY = 4 };
    if (kind < 0 || kind > ANY)
        return BAD_KIND;
    if (width > to->pitch || width > from->pitch)
        return BAD_PITCH;
    if (!width || !height)
        return SUCCESS;
    int there = locate(to, width, height) & locate(from, width, height);
    /* What is called the host's may be the device's, but not the reverse. */
    int allowed = (on_device(to) || !(kind & TO_DEVICE)) &&
                  (on_device(from) || !(kind & FROM_DEVICE));
    return there && allowed ? SUCCESS : INVALID_VALUE;
}

static int copy(const char *call, struct plane to, struct plane from, size_t width, size_t height,
                int kind, void *stream) {
    uint32_t digest = 1;
    enter();
    int code = is_stream(stream) ? check_copy(&to, &from, width, height, kind) : INVALID_RESOURCE;
    for (size_t row = 0; !code && width && row < height; row++) {
        const char *source = from.bytes + row * from.pitch;
        if (from.object && from.object->kind == IMPORTED)
            digest = adler32(digest, source, width);
        memmove(to.bytes + row * to.pitch, source, width);
    }
    return leave(call, code, "\"memory\":\"%s\",\"offset\":%zu,\"pitch\":%zu,\"to\":\"%s\","
                 "\"to_offset\":%zu,\"width\":%zu,\"height\":%zu,\"stream\":%d,\"digest\":%u",
                 from.object ? from.object->name : "", from.offset, from.pitch,
                 to.object ? to.object->name : "", to.offset, width, height, number_of(stream),
                 digest);
}

#define PLANE(pointer, pitch) ((struct plane){(char *)(uintptr_t)(pointer), pitch, NULL, 0})

API int cudaMemcpy(void *to, const void *from, size_t size, int kind) {
    return copy("Memcpy", PLANE(to, size), PLANE(from, size), size, 1, kind, NULL);
}
API int cudaMemcpyAsync(void *to, const void *from, size_t size, int kind, void *stream) {
    return copy("MemcpyAsync", PLANE(to, size), PLANE(from, size), size, 1, kind, stream);
}
API int cudaMemcpy2D(void *to, size_t to_pitch, const void *from, size_t pitch, size_t width,
                     size_t height, int kind) {
    return copy("Memcpy2D", PLANE(to, to_pitch), PLANE(from, pitch), width, height, kind, NULL);
}
API int cudaMemcpy2DAsync(void *to, size_t to_pitch, const void *from, size_t pitch, size_t width,
                          size_t height, int kind, void *stream) {
    return copy("Memcpy2DAsync", PLANE(to, to_pitch), PLANE(from, pitch), width, height, kind,
                stream);
}

API int cudaMemsetAsync(void *pointer, int value, size_t size, void *stream) {
    struct plane to = PLANE(pointer, size);
    enter();
    int code = is_stream(stream) ? SUCCESS : INVALID_RESOURCE;
    if (!code && size && !(locate(&to, size, 1) && on_device(&to)))
        code = INVALID_VALUE;
    if (!code && size)
        memset(to.bytes, value, size);
    return leave("Memset", code, "\"to\":\"%s\",\"to_offset\":%zu,\"width\":%zu,\"stream\":%d",
                 to.object ? to.object->name : "", to.offset, size, number_of(stream));
}
API int cudaMemset(void *to, int value, size_t size) { return cudaMemsetAsync(to, value, size, 0); }
