/* Streams and events. A stream that is told to wait for an event is waited for there and then: an
   order of things that the real runtime may choose too. */

#include "objects.h"

#define WAIT_SECONDS 10

int is_stream(const void *stream) {
    return (uintptr_t)stream <= 2 || known(stream, STREAM); /* default, legacy, a thread's own */
}

int number_of(const void *stream) {
    const struct object *object = known(stream, STREAM);
    return object ? object->number : !is_stream(stream) ? -1 : (uintptr_t)stream == 2 ? 2 : 0;
}

API int cudaStreamCreateWithFlags(void **stream, unsigned flags) {
    const unsigned non_blocking = 1;
    static int created = 2;
    enter();
    struct object *object = stream && flags <= non_blocking ? create(STREAM, 0) : NULL;
    if (object) {
        object->number = ++created;
        *stream = object;
    }
    return leave("StreamCreate", object ? SUCCESS : INVALID_VALUE, "\"stream\":%d,\"flags\":%u",
                 object ? object->number : -1, flags);
}
API int cudaStreamCreate(void **stream) { return cudaStreamCreateWithFlags(stream, 0); }

static int idle(const char *call, void *stream, int ends) {
    enter();
    int code = is_stream(stream) && !(ends && !known(stream, STREAM)) ? SUCCESS : INVALID_RESOURCE;
    int number = number_of(stream);
    if (ends && !code)
        drop(stream);
    return leave(call, code, "\"stream\":%d", number);
}
API int cudaStreamSynchronize(void *stream) { return idle("StreamSynchronize", stream, 0); }
API int cudaStreamQuery(void *stream) { return idle("StreamQuery", stream, 0); }
API int cudaStreamDestroy(void *stream) { return idle("StreamDestroy", stream, 1); }

/* Events */

enum { DISABLE_TIMING = 2, INTERPROCESS = 4, ALL_FLAGS = 7 };

static struct progress *progress_of(const struct object *event) {
    return (struct progress *)(void *)event->bytes;
}

static uint64_t recorded(const struct object *event) {
    return __atomic_load_n(&progress_of(event)->recorded, __ATOMIC_ACQUIRE);
}

static int is_done(const struct object *event, uint64_t count) {
    return __atomic_load_n(&progress_of(event)->completed, __ATOMIC_ACQUIRE) >= count;
}

API int cudaEventCreateWithFlags(void **event, unsigned flags) {
    struct object *object = NULL;
    enter();
    int code = flags > ALL_FLAGS || !event ? INVALID_VALUE : SUCCESS;
    if (flags & INTERPROCESS && !(flags & DISABLE_TIMING))
        code = INVALID_VALUE;
    if (!code && !(object = create(EVENT, sizeof(struct progress))))
        code = OUT_OF_MEMORY;
    if (object) {
        object->flags = flags;
        *event = object;
    }
    return leave("EventCreate", code, "\"event\":\"%s\",\"flags\":%u", object ? object->name : "",
                 flags);
}
API int cudaEventCreate(void **event) { return cudaEventCreateWithFlags(event, 0); }

/* Wait for what was recorded last; another thread may destroy the event meanwhile. */
static int await(struct object *event) {
    const uint64_t count = recorded(event);
    const double limit = now() + WAIT_SECONDS;
    while (known(event, EVENT) && !is_done(event, count)) {
        if (now() > limit)
            return TIMEOUT;
        let_others_in();
    }
    return SUCCESS;
}

static int record(struct object *event) {
    usleep(getenv("SPLATBUS_STAND_IN_SLOW") ? 5000 : 0); /* parts what is done before from after */
    uint64_t count = __atomic_add_fetch(&progress_of(event)->recorded, 1, __ATOMIC_ACQ_REL);
    __atomic_store_n(&progress_of(event)->completed, count, __ATOMIC_RELEASE);
    event->at = now();
    return SUCCESS;
}

static int query(struct object *event) {
    return is_done(event, recorded(event)) ? SUCCESS : NOT_READY;
}

static int destroy(struct object *event) {
    drop(event);
    return SUCCESS;
}

static int use(const char *call, void *event, void *stream, int (*what)(struct object *)) {
    enter();
    struct object *object = known(event, EVENT), before = object ? *object : (struct object){0};
    int code = object && is_stream(stream) ? what(object) : INVALID_RESOURCE;
    return leave(call, code, "\"event\":\"%s\",\"stream\":%d", before.name, number_of(stream));
}

API int cudaEventRecord(void *event, void *on) { return use("EventRecord", event, on, record); }
API int cudaEventQuery(void *event) { return use("EventQuery", event, NULL, query); }
API int cudaEventSynchronize(void *event) { return use("EventSynchronize", event, NULL, await); }
API int cudaEventDestroy(void *event) { return use("EventDestroy", event, NULL, destroy); }
API int cudaStreamWaitEvent(void *stream, void *event, unsigned flags) {
    const unsigned external = 1;
    if (flags <= external)
        return use("StreamWaitEvent", event, stream, await);
    enter();
    return leave("StreamWaitEvent", INVALID_VALUE, "\"flags\":%u", flags);
}

API int cudaEventElapsedTime(float *milliseconds, void *from, void *to) {
    enter();
    struct object *a = known(from, EVENT), *b = known(to, EVENT);
    int code = milliseconds ? INVALID_RESOURCE : INVALID_VALUE;
    if (milliseconds && a && b && !((a->flags | b->flags) & DISABLE_TIMING) && a->at && b->at) {
        *milliseconds = (float)((b->at - a->at) * 1e3);
        code = SUCCESS;
    }
    return leave("EventElapsedTime", code, "\"event\":\"%s\"", a ? a->name : "");
}

API int cudaIpcGetEventHandle(struct handle *handle, void *event) {
    enter();
    struct object *object = known(event, EVENT);
    int own = object && object->flags & INTERPROCESS && object->exporter == getpid();
    int code = !handle || !event ? INVALID_VALUE : own ? SUCCESS : INVALID_RESOURCE;
    if (!code)
        write_handle(handle, object);
    return leave("IpcGetEventHandle", code, "\"event\":\"%s\"", object ? object->name : "");
}

API int cudaIpcOpenEventHandle(void **event, struct handle handle) {
    struct object *object = NULL;
    enter();
    int code = event ? import(&handle, EVENT, &object) : INVALID_VALUE;
    if (object) {
        object->flags = INTERPROCESS | DISABLE_TIMING;
        *event = object;
    }
    return leave("IpcOpenEventHandle", code, "\"event\":\"%s\"", object ? object->name : "");
}
