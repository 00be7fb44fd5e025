/* The driver's calls, for programs that load libcuda themselves: each is the runtime's call that does
   the same, leaves that one's line in the trace, and besides needs a current context. Error codes are
   those of driver 580 on an H100. */

#include "objects.h"
#include "runtime.h"

#include <dlfcn.h>

#define MOST_DEVICES 64
#define MOST_CONTEXTS 64 /* on a thread's stack */
enum { NOT_INITIALIZED = 3, NO_CONTEXT = 201, NOT_FOUND = 500, NOT_SUPPORTED = 801 };
enum { UP = 1, DOWN = 2, WITHIN = 3, ANY = 4 }; /* directions of the runtime's copies */

typedef uintptr_t pointer; /* CUdeviceptr */
struct context {
    unsigned retained;
};
const int is_the_driver = 1;
static struct context contexts[MOST_DEVICES];
static int initialized;
static _Thread_local struct context *stack[MOST_CONTEXTS];
static _Thread_local int depth;

static int is_context(const struct context *context) {
    return context >= contexts && context < contexts + MOST_DEVICES && context->retained;
}

/* Why a call cannot do anything, or 0. */
static int refusal(void) {
    return !initialized                                ? NOT_INITIALIZED
           : !depth || !is_context(stack[depth - 1])  ? NO_CONTEXT
                                                       : SUCCESS;
}
#define NEEDS_CONTEXT                                                                           \
    do {                                                                                        \
        int refused = refusal();                                                                \
        if (refused)                                                                            \
            return refused;                                                                     \
    } while (0)
/* A stream that was created knows its context, as an event does. */
#define ON(stream, call)                                                                        \
    do {                                                                                        \
        if ((uintptr_t)(stream) <= 2)                                                           \
            NEEDS_CONTEXT;                                                                      \
        return of_the_driver(call);                                                             \
    } while (0)
#define IN_CONTEXT(call)                                                                        \
    do {                                                                                        \
        NEEDS_CONTEXT;                                                                          \
        return of_the_driver(call);                                                             \
    } while (0)

static int of_the_driver(int code) {
    return code == BAD_PITCH || code == BAD_KIND ? INVALID_VALUE : code;
}

API int cuInit(unsigned flags) {
    if (flags)
        return INVALID_VALUE;
    initialized = 1; /* by a runtime of the program's own too, which then asks for what is not here */
    return SUCCESS;
}

API int cuDriverGetVersion(int *version) {
    return version ? cudaDriverGetVersion(version) : INVALID_VALUE;
}

/* Errors */

static const struct text {
    int code;
    const char *name, *text;
} texts[] = {
    {SUCCESS, "CUDA_SUCCESS", "no error"},
    {INVALID_VALUE, "CUDA_ERROR_INVALID_VALUE", "invalid argument"},
    {OUT_OF_MEMORY, "CUDA_ERROR_OUT_OF_MEMORY", "out of memory"},
    {NOT_INITIALIZED, "CUDA_ERROR_NOT_INITIALIZED", "initialization error"},
    {INVALID_DEVICE, "CUDA_ERROR_INVALID_DEVICE", "invalid device ordinal"},
    {NO_CONTEXT, "CUDA_ERROR_INVALID_CONTEXT", "invalid device context"},
    {NO_EVENT, "CUDA_ERROR_MAP_FAILED", "mapping of buffer object failed"},
    {INVALID_RESOURCE, "CUDA_ERROR_INVALID_HANDLE", "invalid resource handle"},
    {NOT_FOUND, "CUDA_ERROR_NOT_FOUND", "named symbol not found"},
    {NOT_READY, "CUDA_ERROR_NOT_READY", "device not ready"},
    {TIMEOUT, "CUDA_ERROR_LAUNCH_TIMEOUT", "the launch timed out and was terminated"},
    {NOT_SUPPORTED, "CUDA_ERROR_NOT_SUPPORTED", "operation not supported"},
};

static const struct text *text_of(int code) {
    for (const struct text *each = texts; each < texts + sizeof texts / sizeof *texts; each++)
        if (each->code == code)
            return each;
    return NULL;
}

static int say(const struct text *found, const char *what, const char **to) {
    if (!to)
        return INVALID_VALUE;
    *to = found ? what : NULL;
    return found ? SUCCESS : INVALID_VALUE;
}

API int cuGetErrorName(int code, const char **to) {
    const struct text *found = text_of(code);
    return say(found, found ? found->name : NULL, to);
}

API int cuGetErrorString(int code, const char **to) {
    const struct text *found = text_of(code);
    return say(found, found ? found->text : NULL, to);
}

/* Devices and their primary contexts, one a device */

static int count_of_devices(void) {
    int count = 0;
    cudaGetDeviceCount(&count);
    return count < MOST_DEVICES ? count : MOST_DEVICES;
}

static int check_device(int which) {
    return !initialized                                 ? NOT_INITIALIZED
           : which >= 0 && which < count_of_devices() ? SUCCESS
                                                       : INVALID_DEVICE;
}

API int cuDeviceGetCount(int *count) {
    if (!initialized)
        return NOT_INITIALIZED;
    return count ? cudaGetDeviceCount(count) : INVALID_VALUE;
}

API int cuDeviceGet(int *to, int which) {
    int code = check_device(which);
    if (!code && !to)
        return INVALID_VALUE;
    if (!code)
        *to = which;
    return code;
}

API int cuDeviceGetName(char *name, int length, int which) {
    int code = check_device(which);
    if (code || !name || length < 1)
        return code ? code : INVALID_VALUE;
    snprintf(name, (size_t)length, "SplatBus stand-in %d", which);
    return SUCCESS;
}

/* GPU-00000000-0000-4000-8000-0000000000 and the number of the device: see device.py. */
API int cuDeviceGetUuid_v2(unsigned char *uuid, int which) {
    int code = check_device(which);
    if (code || !uuid)
        return code ? code : INVALID_VALUE;
    memset(uuid, 0, 16);
    uuid[6] = 0x40;
    uuid[8] = 0x80;
    uuid[15] = (unsigned char)which;
    return SUCCESS;
}
API int cuDeviceGetUuid(unsigned char *uuid, int which) { return cuDeviceGetUuid_v2(uuid, which); }

API int cuDeviceGetAttribute(int *value, int attribute, int which) {
    int code = check_device(which);
    return code ? code : cudaDeviceGetAttribute(value, attribute, which);
}

API int cuDevicePrimaryCtxRetain(struct context **to, int which) {
    int code = check_device(which);
    if (code || !to)
        return code ? code : INVALID_VALUE;
    load();
    enter();
    contexts[which].retained++;
    *to = contexts + which;
    return leave("PrimaryCtxRetain", SUCCESS, "\"which\":%d", which);
}

API int cuDevicePrimaryCtxRelease_v2(int which) {
    int code = check_device(which);
    if (code)
        return code;
    enter();
    code = contexts[which].retained ? SUCCESS : NO_CONTEXT;
    contexts[which].retained -= !code;
    return leave("PrimaryCtxRelease", code, "\"which\":%d", which);
}

static void settle(void) { device = depth ? (int)(stack[depth - 1] - contexts) : 0; }

API int cuCtxPushCurrent_v2(struct context *context) {
    if (!initialized)
        return NOT_INITIALIZED;
    if (!context)
        return INVALID_VALUE;
    if (!is_context(context) || depth == MOST_CONTEXTS)
        return NO_CONTEXT;
    stack[depth++] = context;
    settle();
    return SUCCESS;
}

API int cuCtxPopCurrent_v2(struct context **to) {
    NEEDS_CONTEXT;
    struct context *popped = stack[--depth];
    if (to)
        *to = popped;
    settle();
    return SUCCESS;
}

API int cuCtxSetCurrent(struct context *context) {
    if (!initialized)
        return NOT_INITIALIZED;
    if (context && !is_context(context))
        return NO_CONTEXT;
    depth -= depth > 0;
    if (context)
        stack[depth++] = context;
    settle();
    return SUCCESS;
}

API int cuCtxGetCurrent(struct context **to) {
    if (!initialized || !to)
        return initialized ? INVALID_VALUE : NOT_INITIALIZED;
    *to = depth ? stack[depth - 1] : NULL;
    return SUCCESS;
}

API int cuCtxGetDevice(int *to) {
    NEEDS_CONTEXT;
    return to ? cudaGetDevice(to) : INVALID_VALUE;
}

API int cuCtxSynchronize(void) { IN_CONTEXT(cudaDeviceSynchronize()); }

/* Memory */

#define TO(place) ((void *)(place))
#define AT(place) ((void *)(uintptr_t)(place))

API int cuMemAlloc_v2(pointer *to, size_t size) {
    NEEDS_CONTEXT;
    return size ? cudaMalloc(TO(to), size) : INVALID_VALUE;
}
API int cuMemFree_v2(pointer at) { return cudaFree(AT(at)); }
API int cuMemHostAlloc(void **to, size_t size, unsigned flags) {
    NEEDS_CONTEXT;
    return flags <= 7 ? cudaMallocHost(to, size) : INVALID_VALUE;
}
API int cuMemAllocHost_v2(void **to, size_t size) { return cuMemHostAlloc(to, size, 0); }
API int cuMemFreeHost(void *at) { return cudaFreeHost(at); }

API int cuMemGetAddressRange_v2(pointer *begin, size_t *size, pointer at) {
    NEEDS_CONTEXT;
    enter();
    const struct object *object = containing(AT(at));
    const int code = object ? SUCCESS : NOT_FOUND;
    if (object && begin)
        *begin = (pointer)object->address;
    if (object && size)
        *size = object->size;
    return leave("MemGetAddressRange", code, "\"memory\":\"%s\"", object ? object->name : "");
}

API int cuMemsetD8Async(pointer at, unsigned char value, size_t size, void *stream) {
    ON(stream, cudaMemsetAsync(AT(at), value, size, stream));
}
API int cuMemsetD8_v2(pointer at, unsigned char value, size_t size) {
    IN_CONTEXT(cudaMemset(AT(at), value, size));
}

API int cuMemcpy(pointer to, pointer from, size_t size) {
    IN_CONTEXT(cudaMemcpy(AT(to), AT(from), size, ANY));
}
API int cuMemcpyAsync(pointer to, pointer from, size_t size, void *stream) {
    ON(stream, cudaMemcpyAsync(AT(to), AT(from), size, ANY, stream));
}
API int cuMemcpyDtoH_v2(void *to, pointer from, size_t size) {
    IN_CONTEXT(cudaMemcpy(to, AT(from), size, DOWN));
}
API int cuMemcpyDtoHAsync_v2(void *to, pointer from, size_t size, void *stream) {
    ON(stream, cudaMemcpyAsync(to, AT(from), size, DOWN, stream));
}
API int cuMemcpyHtoD_v2(pointer to, const void *from, size_t size) {
    IN_CONTEXT(cudaMemcpy(AT(to), from, size, UP));
}
API int cuMemcpyHtoDAsync_v2(pointer to, const void *from, size_t size, void *stream) {
    ON(stream, cudaMemcpyAsync(AT(to), from, size, UP, stream));
}
API int cuMemcpyDtoD_v2(pointer to, pointer from, size_t size) {
    IN_CONTEXT(cudaMemcpy(AT(to), AT(from), size, WITHIN));
}
API int cuMemcpyDtoDAsync_v2(pointer to, pointer from, size_t size, void *stream) {
    ON(stream, cudaMemcpyAsync(AT(to), AT(from), size, WITHIN, stream));
}

API int cuMemsetD32Async(pointer at, uint32_t value, size_t count, void *stream) {
    uint32_t *values = calloc(count, sizeof value);
    for (size_t each = 0; values && each < count; each++)
        values[each] = value;
    int code = values ? cuMemcpyHtoDAsync_v2(at, values, count * sizeof value, stream)
                      : OUT_OF_MEMORY;
    free(values);
    return code;
}
API int cuMemGetInfo_v2(size_t *left, size_t *all) {
    NEEDS_CONTEXT;
    if (!left || !all)
        return INVALID_VALUE;
    *left = *all = MOST_BYTES; /* of the host's, until an allocation fails */
    return SUCCESS;
}

struct end { /* of a copy of rows, half of a CUDA_MEMCPY2D */
    size_t x, y;
    int type;
    void *host;
    pointer device;
    void *array;
    size_t pitch;
};
struct rows {
    struct end from, to;
    size_t width, height;
};

static char *place(const struct end *end) {
    enum { HOST = 1, DEVICE = 2, UNIFIED = 4 };
    char *start = end->type == HOST ? end->host : AT(end->device);
    const int is_known = end->type == HOST || end->type == DEVICE || end->type == UNIFIED;
    return is_known && start ? start + end->y * end->pitch + end->x : NULL;
}

static int copy_rows(const struct rows *rows, void *stream, int is_async) {
    if ((uintptr_t)stream <= 2)
        NEEDS_CONTEXT;
    char *to = rows ? place(&rows->to) : NULL, *from = rows ? place(&rows->from) : NULL;
    if (!to || !from)
        return INVALID_VALUE;
    const size_t to_pitch = rows->to.pitch ? rows->to.pitch : rows->width;
    const size_t pitch = rows->from.pitch ? rows->from.pitch : rows->width;
    return of_the_driver(is_async ? cudaMemcpy2DAsync(to, to_pitch, from, pitch, rows->width,
                                                      rows->height, ANY, stream)
                                  : cudaMemcpy2D(to, to_pitch, from, pitch, rows->width,
                                                 rows->height, ANY));
}
API int cuMemcpy2D_v2(const struct rows *rows) { return copy_rows(rows, NULL, 0); }
API int cuMemcpy2DAsync_v2(const struct rows *rows, void *stream) {
    return copy_rows(rows, stream, 1);
}

/* Streams, events, handles */

API int cuStreamCreate(void **to, unsigned flags) {
    IN_CONTEXT(cudaStreamCreateWithFlags(to, flags));
}
API int cuStreamSynchronize(void *stream) { ON(stream, cudaStreamSynchronize(stream)); }
API int cuStreamQuery(void *stream) { ON(stream, cudaStreamQuery(stream)); }
API int cuStreamDestroy_v2(void *stream) { ON(stream, cudaStreamDestroy(stream)); }
API int cuStreamWaitEvent(void *stream, void *event, unsigned flags) {
    ON(stream, cudaStreamWaitEvent(stream, event, flags));
}
API int cuEventCreate(void **to, unsigned flags) {
    IN_CONTEXT(cudaEventCreateWithFlags(to, flags));
}
API int cuEventRecord(void *event, void *stream) { ON(stream, cudaEventRecord(event, stream)); }
API int cuEventQuery(void *event) { return cudaEventQuery(event); }
API int cuEventSynchronize(void *event) { return cudaEventSynchronize(event); }
API int cuEventDestroy_v2(void *event) { return cudaEventDestroy(event); }
API int cuEventElapsedTime(float *to, void *from, void *until) {
    return cudaEventElapsedTime(to, from, until);
}

API int cuIpcGetMemHandle(struct handle *to, pointer at) {
    IN_CONTEXT(cudaIpcGetMemHandle(to, AT(at)));
}
API int cuIpcOpenMemHandle_v2(pointer *to, struct handle handle, unsigned flags) {
    IN_CONTEXT(cudaIpcOpenMemHandle(TO(to), handle, flags));
}
API int cuIpcCloseMemHandle(pointer at) { IN_CONTEXT(cudaIpcCloseMemHandle(AT(at))); }
API int cuIpcGetEventHandle(struct handle *to, void *event) {
    IN_CONTEXT(cudaIpcGetEventHandle(to, event));
}
API int cuIpcOpenEventHandle(void **to, struct handle handle) {
    IN_CONTEXT(cudaIpcOpenEventHandle(to, handle));
}

/* Where a function is: some programs ask for all of them by this one. */
API int cuGetProcAddress_v2(const char *name, void **to, int version, uint64_t flags, int *status) {
    enum { FOUND = 0, MISSING = 1 };
    char newer[128];
    Dl_info own;
    (void)version, (void)flags;
    if (!name || !to || !dladdr(AT(cuInit), &own))
        return INVALID_VALUE;
    void *library = dlopen(own.dli_fname, RTLD_LAZY | RTLD_NOLOAD);
    snprintf(newer, sizeof newer, "%s_v2", name);
    *to = library ? dlsym(library, newer) : NULL;
    if (library && !*to && !strncmp(name, "cu", 2))
        *to = dlsym(library, name);
    if (library)
        dlclose(library);
    if (status)
        *status = *to ? FOUND : MISSING;
    return SUCCESS;
}
API int cuGetProcAddress(const char *name, void **to, int version, uint64_t flags) {
    return cuGetProcAddress_v2(name, to, version, flags, NULL);
}
